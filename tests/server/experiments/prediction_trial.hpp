// Trials of a prediction in virtual time: a simulated robot with the default sensor in a fluid that nobody knows; its
// record, the model fitted to it, a controller tuned for that, a closed-loop run, and the band predicted for the run.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "control/models/plant_models.hpp"
#include "robot_fw/core/safety.hpp"
#include "server/experiments/preview_band.hpp"
#include "server/experiments/runner/prediction.hpp"

namespace server::experiments {

enum class ModelFrom : std::uint8_t {
  fit,   // of a record of 60 s
  drawn  // around the fluid, by the sigmas of the best fit to such a record: a hundredth of the time
};

struct PredictionTrial {
  control::FractionalModel fluid;
  std::uint64_t seed = 1;
  std::string profile = "figure_7";
  robot_fw::DutyRange duty{-1, 1};
  ModelFrom model_from = ModelFrom::fit;
};

struct TrialRun {
  PredictionRequest request;  // by which the run is predicted
  // At the ticks of the prediction. The measured position is the one of telemetry, without the disturbance.
  std::vector<double> measured_m, true_m;
};

TrialRun run_of(const PredictionTrial& trial);

// The instants of runs, their positions beside the predicted ones, and the bands.
class BandTally {
 public:
  void add(const TrialRun& run);
  void add(const BandTally& others);

  double share_within() const;         // of the instants, the measured position within 2 sd
  double share_within_before() const;  // the same with the parameters alone
  double share_true_within() const;    // the true position within 2 true_sd
  double rms_m() const;                // measured less predicted
  double true_rms_m() const;
  double half_width_rms_m() const;  // of 2 sd
  double half_width_median_m() const;
  double true_half_width_rms_m() const;
  double part_rms_m(std::size_t part) const;  // sd: parameters, estimator, sensor, start

 private:
  struct Instant {
    double measured_m = 0, true_m = 0;  // less the predicted one
    double sd_m = 0, true_sd_m = 0;
    std::array<double, 4> parts_m{};
  };
  template <class Value>
  double rms(Value value) const;
  template <class Test>
  double share(Test test) const;

  std::vector<Instant> instants_;
};

}  // namespace server::experiments
