// The job `tune_measured`: a controller from a recorded run with three tones, without a model.
//
// The run is read page by page, the rest is computed on the thread of the jobs. Errors: as of the job `identify`. A run
// that does not show the tones, and a specification without solution, are results with a reason.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <optional>
#include <string>

#include "control/tuning/design.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/storage/jobs/job_run.hpp"

namespace server::analysis {

struct MeasuredTuneRequest {
  storage::RunId run = 0;
  RunWindow window;  // its first 5 s are left out: the beginning of the tones dies away
  control::TuningSpec spec;
  double period_s = 0.01;
  std::optional<double> duty_min, duty_max;  // as in TuneRequest
};

// `feasible`, `reason`, `measured` (points, phase_fall, used_s), `asked`; where it is feasible kp, kd, mu, the sigmas
// of what is achieved, and `discretised` as of the job `tune`.
boost::asio::awaitable<Result<std::string>> measured_tune_job(AnalysisService& analysis, MeasuredTuneRequest request,
                                                              storage::JobRun& run);

}  // namespace server::analysis
