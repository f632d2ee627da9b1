// How fast the control library is: identification, one step of the plant, tuning, discretisation, Bode diagram.
//
//   build/release/bin/control_bench --benchmark_repetitions=9 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <vector>

#include "control/discretisation/discretise.hpp"
#include "control/identification/identify.hpp"
#include "control/models/modal_form.hpp"
#include "control/models/modal_plant.hpp"
#include "control/responses/margins.hpp"
#include "control/responses/time_response.hpp"
#include "control/search/output_model.hpp"
#include "control/sensor/sensor_path.hpp"
#include "control/tuning/tune.hpp"

namespace control {
namespace {

constexpr double kPeriodS = 0.01, kDuty = 0.3, kVelocityNoiseM_s = 1e-4;

// The golden record of 501 points: velocity, white noise of 0.1 mm/s.
Recording golden_recording() {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/identification_dataset.json"));
  Recording recording;
  recording.dt_s = kPeriodS;
  recording.velocity_m_s = golden["datasets"][0]["y"].get<std::vector<double>>();
  recording.duty.assign(recording.velocity_m_s.size(), kDuty);
  return recording;
}

// Made the same way as the golden one, for any number of points.
Recording made_recording(int points) {
  std::mt19937_64 random{1};
  std::normal_distribution<double> noise{0, kVelocityNoiseM_s};
  Recording recording;
  recording.dt_s = kPeriodS;
  ModalPlant plant{kNonNewtonianModel, kPeriodS};
  for (int k = 0; k < points; ++k) {
    recording.velocity_m_s.push_back(plant.velocity_m_s() + noise(random));
    recording.duty.push_back(kDuty);
    plant.step(kDuty);
  }
  return recording;
}

// One fractional fit from the paper's start.
void identify_fractional(benchmark::State& state, const Recording& recording) {
  IdentificationOptions options;
  options.structure = Structure::fractional;
  options.further_starts = 0;
  options.fits_offset = false;  // as the golden fits
  for (auto _ : state) benchmark::DoNotOptimize(identify(recording, options).best.sse);
}
BENCHMARK_CAPTURE(identify_fractional, golden_501_points, golden_recording())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(identify_fractional, made_6001_points, made_recording(6001))->Unit(benchmark::kMillisecond);

// Everything a lab gets by default: three structures, five starts each.
void identify_all(benchmark::State& state) {
  const Recording recording = golden_recording();
  for (auto _ : state) benchmark::DoNotOptimize(identify(recording, {}).best.sse);
}
BENCHMARK(identify_all)->Unit(benchmark::kMillisecond);

constexpr double kMinuteS = 60;

// A position that was measured at the ticks, with 0.5 mm of noise.
Recording measured_position() {
  std::mt19937_64 random{2};
  std::normal_distribution<double> noise{0, 5e-4};
  Recording recording;
  recording.duty = prbs_duty(0.6, 0.5, kMinuteS, kPeriodS);
  ModalPlant plant{kNonNewtonianModel, kPeriodS};
  for (const double duty : recording.duty) {
    recording.position_m.push_back(plant.position_m() + noise(random));
    plant.step(duty);
  }
  return recording;
}

// Readings of an accelerometer with a clock of its own, 0.3 % slow, and a bias; in steps of 0.01 m/s².
Recording accelerometer_readings() {
  std::mt19937_64 random{3};
  std::normal_distribution<double> noise{0, 0.012};
  Recording recording;
  recording.duty = prbs_duty(0.6, 0.5, kMinuteS, kPeriodS);
  const Eigen::VectorXd felt_m_s2 =
      OutputModel::with_means(kPeriodS, recording.duty, 1e-9).output(normalised(kNonNewtonianModel));
  SensorPath path({std::vector<double>(recording.duty.size()), std::vector<bool>(recording.duty.size()), false},
                  kPeriodS);
  path.set_order({-0.3 * kPeriodS, 1.003 * kPeriodS}, 0);
  for (const double exact : path.sampled(felt_m_s2, {-0.6 * kPeriodS, 1.003 * kPeriodS, 0.25 * kPeriodS})) {
    recording.acceleration_m_s2.push_back(0.01 * std::round((exact + noise(random)) / 0.01) - 0.0031);
  }
  return recording;
}

// 60 s at 100 Hz, as a job of the station computes it by default; the bounds are those of docs/control.md.
void identify_minute(benchmark::State& state, const Recording& recording) {
  for (auto _ : state) benchmark::DoNotOptimize(identify(recording, {}).best.sse);
}
BENCHMARK_CAPTURE(identify_minute, position, measured_position())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(identify_minute, acceleration, accelerometer_readings())->Unit(benchmark::kMillisecond);

// The same from two halves, each with unknowns of its own.
void identify_two_halves(benchmark::State& state) {
  const Recording whole = measured_position();
  const std::size_t half = whole.duty.size() / 2;
  std::vector<Recording> runs(2);
  for (Recording& run : runs) {
    run.duty.assign(whole.duty.begin(), whole.duty.begin() + static_cast<std::ptrdiff_t>(half));
    run.position_m.assign(whole.position_m.begin(), whole.position_m.begin() + static_cast<std::ptrdiff_t>(half));
  }
  for (auto _ : state) benchmark::DoNotOptimize(identify_together(runs, {}).best.sse);
}
BENCHMARK(identify_two_halves)->Unit(benchmark::kMillisecond);

void modal_plant_step(benchmark::State& state) {
  ModalPlant plant{kNonNewtonianModel, kPeriodS};
  double duty = kDuty;
  for (auto _ : state) {
    plant.step(duty);
    benchmark::DoNotOptimize(duty = -duty);
  }
  benchmark::DoNotOptimize(plant.position_m());
}
BENCHMARK(modal_plant_step)->Unit(benchmark::kNanosecond);

// What modal_plant_step is to be compared with: the same number of complex states, multiplied and added up, no more.
void bare_complex_loop(benchmark::State& state) {
  const std::size_t modes = modal_form(kNonNewtonianModel, {}).rate.size();
  std::vector<double> real(modes, 1), imag(modes, 0), decay_real(modes, std::cos(0.1)),
      decay_imag(modes, std::sin(0.1));
  for (auto _ : state) {
    double sum = 0;
    for (std::size_t i = 0; i < modes; ++i) {
      const double next = decay_real[i] * real[i] - decay_imag[i] * imag[i];
      imag[i] = decay_real[i] * imag[i] + decay_imag[i] * real[i];
      real[i] = next;
      sum += next;
    }
    benchmark::DoNotOptimize(sum);
  }
}
BENCHMARK(bare_complex_loop)->Unit(benchmark::kNanosecond);

void tune_exactly(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(tune(kNonNewtonianModel, {5, 91, {}, false}).is_feasible);
}
BENCHMARK(tune_exactly)->Unit(benchmark::kMicrosecond);

// The paper's specification: no solution, so the nearest and the relaxed designs are found.
void tune_infeasible(benchmark::State& state) {
  const TuningSpec spec{65, 72, {}, false};
  for (auto _ : state) benchmark::DoNotOptimize(tune(kNonNewtonianModel, spec).is_feasible);
}
BENCHMARK(tune_infeasible)->Unit(benchmark::kMicrosecond);

void discretise_paper_controller(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(discretise(kPaperController, {}).dc_gain);
}
BENCHMARK(discretise_paper_controller)->Unit(benchmark::kMillisecond);

void bode_200_points(benchmark::State& state) {
  const OpenLoop loop{kNonNewtonianModel, kPaperController, false};
  const std::vector<double> omega_rad_s = log_spaced(0.01, 1000, 200);
  for (auto _ : state) benchmark::DoNotOptimize(bode(loop, omega_rad_s).data());
}
BENCHMARK(bode_200_points)->Unit(benchmark::kMicrosecond);

void margins_of_the_loop(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(margins({kNonNewtonianModel, kPaperController, false}).ms);
}
BENCHMARK(margins_of_the_loop)->Unit(benchmark::kMicrosecond);

void step_response_200_points(benchmark::State& state) {
  const std::vector<double> time_s = log_spaced(0.01, 60, 200);
  for (auto _ : state) benchmark::DoNotOptimize(step_response(kNonNewtonianModel, kDuty, time_s).position_m.data());
}
BENCHMARK(step_response_200_points)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace control
