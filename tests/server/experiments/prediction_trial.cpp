// Records, identifies, tunes, sends the model and the controller, and drives the profile, all in virtual time.
#include "tests/server/experiments/prediction_trial.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>

#include "control/discretisation/discretise.hpp"
#include "control/discretisation/estimator_model.hpp"
#include "control/responses/frequency_response.hpp"
#include "control/tuning/tune.hpp"
#include "robot_fw/core/controller_message.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/tuning/robot_controller.hpp"
#include "server/experiments/profile_document.hpp"
#include "server/station/state/fluid_model.hpp"
#include "sim_robot/lab/station_peer.hpp"
#include "tests/sim_robot/identification_trial.hpp"

namespace server::experiments {
namespace {

using nlohmann::json;
using sim_robot::StationPeer;

constexpr std::uint64_t kOtherNoise = 500;  // of the run's seed: another one than that of the record
constexpr int kRestTicks = 300;             // as the prediction assumes
constexpr std::uint64_t kRenewalTicks = 20;
constexpr double kReadingSd_m_s2 = 0.012;  // noise and quantum of the default sensor
constexpr double kCrossover_rad_s = 3, kMargin_deg = 90, kMu = 0.8, kBandwidth_rad_s = 30;
constexpr int kOrder = 5;

struct Known {
  control::FractionalModel model;
  control::ExpectedUncertainty uncertainty;
  bool is_in_grave_doubt = false;
};

Known fitted(const PredictionTrial& trial) {
  control::IdentificationOptions options = sim_robot::one_start_options();
  options.tries_dead_time = true;
  const auto recording = sim_robot::record({trial.fluid, false, sim_robot::study_duty()}, trial.seed);
  const json fit = json::parse(analysis::json_of(control::identify(recording, options)).dump());
  const auto model = analysis::model_from(fit);
  const auto uncertainty = analysis::uncertainty_from(fit);
  const auto doubts = analysis::doubts_from(fit);
  if (!model || !uncertainty || !*uncertainty || !doubts) throw std::runtime_error{"the record has no fit"};
  return {*model, **uncertainty, !analysis::grave_doubts_in_words(*doubts).empty()};
}

// By the lower triangle of the correlation matrix.
Known drawn(const PredictionTrial& trial) {
  control::PlannedExperiment record;
  record.duty = sim_robot::study_duty();
  record.acceleration_sd_m_s2 = kReadingSd_m_s2;
  Known known{trial.fluid, control::expected_uncertainty(trial.fluid, record)};
  Eigen::MatrixXd correlation{control::kParameters, control::kParameters};
  Eigen::VectorXd normal{control::kParameters};
  std::mt19937_64 random{trial.seed};
  std::normal_distribution<double> distribution;
  for (Eigen::Index i = 0; i < normal.size(); ++i) {
    normal(i) = distribution(random);
    for (Eigen::Index j = 0; j < normal.size(); ++j) {
      correlation(i, j) = known.uncertainty.correlation[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
  }
  const Eigen::VectorXd off = correlation.llt().matrixL() * normal;
  const std::array parameters{&known.model.kp, &known.model.b1, &known.model.b2, &known.model.alpha, &known.model.beta};
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    *parameters[i] += off(static_cast<Eigen::Index>(i)) * known.uncertainty.one_sigma[i].value();
  }
  control::check(known.model);
  return known;
}

// The robot's sections act a sample later (docs/protocol.md): r/(1 - p w) is r + r p w/(1 - p w).
protocol::Controller controller_for(const control::FractionalModel& model, const robot_fw::DutyRange& duty) {
  const double later_deg = kCrossover_rad_s * model.dead_time_s * control::kDegPerRad;
  const auto tuned = control::tune(model, {kCrossover_rad_s, kMargin_deg - later_deg, kMu, false});
  if (!tuned.tuned) throw std::runtime_error{"no controller: " + tuned.reason};
  const auto sections =
      control::choose_discretisation(tuned.tuned->controller, kTick_s, kOrder, kBandwidth_rad_s).chosen.sections;
  if (!sections.second_order.empty()) throw std::runtime_error{"the trial sends real sections only"};
  protocol::Controller sent = rheonaut_Controller_init_zero;
  sent.controller_id = 7;
  sent.period_us = 10'000;
  sent.kp = static_cast<float>(control::dc_gain(sections));
  double direct = sections.direct;
  for (const auto& section : sections.first_order) {
    sent.pole[sent.pole_count++] = static_cast<float>(section.pole);
    sent.residue[sent.residue_count++] = static_cast<float>(section.residue * section.pole);
    direct += section.residue;
  }
  sent.direct = static_cast<float>(direct);
  sent.duty_min = duty.min;
  sent.duty_max = duty.max;
  sent.checksum = robot_fw::checksum_of(sent);
  return sent;
}

// As the station does: a model in grave doubt as assumed, one that four sections do not follow not at all.
void send_model(StationPeer& station, const Known& known) {
  const control::EstimatorModel found = control::estimator_model(known.model);
  if (!found.is_met) return;
  const auto send = [&station](const std::string& name, float value) {
    station.send(sim_robot::set_parameter(name.c_str(), value));
    station.step();
  };
  station::FluidModel sent;
  sent.gain_m_s = found.sections.gain_m_s;
  sent.time_constant_s = found.sections.time_constant_s;
  if (known.is_in_grave_doubt) send("model_section_error", station::kAssumedSectionError);
  for (const auto& [name, value] : station::parameters_of(sent)) send(name, value);
  if (!known.is_in_grave_doubt) send("model_confirmed", 1);
}

void apply(StationPeer& station, const Action& action, bool& is_auto) {
  const auto value = static_cast<float>(action.value);
  switch (action.kind) {
    case ActionKind::duty: station.send(sim_robot::set_duty(value)); return;
    case ActionKind::setpoint:
      station.send(is_auto ? sim_robot::set_setpoint(value) : sim_robot::set_auto(value));
      is_auto = true;
      return;
    case ActionKind::disturbance: station.send(sim_robot::inject_disturbance(value)); return;
  }
}

// From the first action on; telemetry has the position at the begin of a tick.
void drive(sim_robot::SimulatedRobot& robot, StationPeer& station, TrialRun& run) {
  const double origin_m = robot.world().position_m();
  const std::uint64_t begins = station.samples.rbegin()->first + 1;
  const TimeLine& line = run.request.line;
  auto next = line.actions.begin();
  bool is_auto = false;
  double duty = 0;
  for (std::uint64_t tick = 0; tick <= line.ticks; ++tick) {
    for (; next != line.actions.end() && next->tick <= tick; ++next) {
      apply(station, *next, is_auto);
      if (next->kind == ActionKind::duty) duty = next->value;
    }
    if (tick % kRenewalTicks == 0 && !is_auto && duty != 0) station.send(sim_robot::renew_lease());
    run.true_m.push_back(robot.world().position_m() - origin_m);
    station.step();
  }
  for (auto sample = station.samples.lower_bound(begins); sample != station.samples.end(); ++sample) {
    run.measured_m.push_back(static_cast<double>(sample->second.position_m - sample->second.disturbance_m));
  }
}

}  // namespace

TrialRun run_of(const PredictionTrial& trial) {
  const Known known = trial.model_from == ModelFrom::fit ? fitted(trial) : drawn(trial);
  TrialRun run;
  run.request.profile = find_profile(trial.profile);
  run.request.line = time_line_of(run.request.profile, {});
  run.request.model = known.model;
  run.request.uncertainty = known.uncertainty;
  run.request.controller = controller_for(known.model, trial.duty);

  sim_robot::SimulatedRobotConfig config;
  config.duty = trial.duty;
  config.world.plant.model = trial.fluid;
  config.world.imu.emplace();
  config.world.seed = trial.seed + kOtherNoise;
  sim_robot::SimulatedRobot robot{config};
  StationPeer station{robot};
  station.welcome.samples_per_frame = 1;
  station.connect();
  send_model(station, known);
  station.send(sim_robot::set_controller(run.request.controller));
  station.run(kRestTicks);
  station.send(sim_robot::zero_position());
  station.step();
  station::ParameterTable parameters;
  for (const auto& page : station.table) parameters.add(page);
  for (const auto& page : station.pages) parameters.add(page);
  run.request.estimate = estimate_of(parameters);
  drive(robot, station, run);
  for (const auto& ack : station.acks) {
    if (ack.result != rheonaut_COMMAND_RESULT_ACCEPTED) throw std::runtime_error{"a command was refused"};
  }
  return run;
}

void BandTally::add(const TrialRun& run) {
  const PredictionRequest& request = run.request;
  const DutyRange duty{request.controller.duty_min, request.controller.duty_max};
  const auto sections = analysis::sections_of(request.controller);
  const Preview preview = preview_of(request.profile, request.line, request.model, sections, duty.min, duty.max);
  const PositionBand band = band_of({request.profile, request.line, request.model, request.uncertainty.value(),
                                     sections, duty, request.estimate.value()});
  for (std::size_t k = 0; k < preview.position_m.size(); ++k) {
    const double predicted_m = preview.position_m[k];
    instants_.push_back({run.measured_m.at(k) - predicted_m,
                         run.true_m.at(k) - predicted_m,
                         band.sd_m[k],
                         band.true_sd_m[k],
                         {band.parameters_m[k], band.estimator_m[k], band.sensor_m[k], band.start_m[k]}});
  }
}

void BandTally::add(const BandTally& others) {
  instants_.insert(instants_.end(), others.instants_.begin(), others.instants_.end());
}

template <class Value>
double BandTally::rms(Value value) const {
  double sum = 0;
  for (const Instant& at : instants_) sum += std::pow(std::invoke(value, at), 2);
  return std::sqrt(sum / static_cast<double>(instants_.size()));
}

template <class Test>
double BandTally::share(Test test) const {
  return static_cast<double>(std::ranges::count_if(instants_, test)) / static_cast<double>(instants_.size());
}

double BandTally::share_within() const {
  return share([](const Instant& at) { return std::abs(at.measured_m) <= 2 * at.sd_m; });
}
double BandTally::share_within_before() const {
  return share([](const Instant& at) { return std::abs(at.measured_m) <= 2 * at.parts_m[0]; });
}
double BandTally::share_true_within() const {
  return share([](const Instant& at) { return std::abs(at.true_m) <= 2 * at.true_sd_m; });
}
double BandTally::rms_m() const { return rms(&Instant::measured_m); }
double BandTally::true_rms_m() const { return rms(&Instant::true_m); }
double BandTally::half_width_rms_m() const { return 2 * rms(&Instant::sd_m); }
double BandTally::true_half_width_rms_m() const { return 2 * rms(&Instant::true_sd_m); }
double BandTally::part_rms_m(std::size_t part) const {
  return rms([part](const Instant& at) { return at.parts_m.at(part); });
}
double BandTally::half_width_median_m() const {
  std::vector<double> widths_m;
  for (const Instant& at : instants_) widths_m.push_back(2 * at.sd_m);
  const auto middle = widths_m.begin() + static_cast<std::ptrdiff_t>(widths_m.size() / 2);
  std::ranges::nth_element(widths_m, middle);
  return *middle;
}

}  // namespace server::experiments
