// The bodies of the jobs `tune`, `tuning_map` and `tune_measured`.
#pragma once

#include <optional>
#include <string>

#include "server/analysis/tuning/measured_tune_job.hpp"
#include "server/analysis/tuning/tune_job.hpp"
#include "server/api/bodies/json.hpp"
#include "server/storage/designs/design.hpp"

namespace server::api {

// The plant to tune for: one of the three.
struct PlantOfJob {
  std::optional<storage::DesignId> model;  // a design
  std::string fluid;                       // its model in force
  std::optional<control::FractionalModel> given;
  analysis::PlantUncertainty given_uncertainty;
  analysis::ModelDoubts given_doubts;
};

// The plant, its source and the fluids of the requests are left to the route, which looks them up.
struct TuneBody {
  PlantOfJob plant;
  analysis::TuneRequest request;
};
struct TuningMapBody {
  PlantOfJob plant;
  analysis::TuningMapRequest request;
};

// e.g. {"kind":"tune","model_id":4,"crossover_rad_s":3,"phase_margin_deg":90,"duty_min":0}
Result<TuneBody> tune_body(const Members& body);

// e.g. {"kind":"tuning_map","fluid":"water","from_rad_s":1,"to_rad_s":20,"points":40}
Result<TuningMapBody> tuning_map_body(const Members& body);

// e.g. {"kind":"tune_measured","run_id":7,"crossover_rad_s":4,"phase_margin_deg":70}
Result<analysis::MeasuredTuneRequest> tune_measured_body(const Members& body);

}  // namespace server::api
