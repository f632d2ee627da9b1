// Asks by the routes, lets virtual time pass, and measures the true position.
#include "tests/system/paper_fixture.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace server {
namespace {

constexpr std::uint64_t kTickUs = sim_robot::SimulatedRobot::kPeriodUs;
// Chosen as that of deploy/demo, where it is said: with it the true position keeps the bounds, as with about 33 of 40.
constexpr std::uint64_t kSeed = 21;
constexpr microseconds kLongestExperiment = 400s;

}  // namespace

double TrueMotion::at(std::uint64_t time_us) const {
  const auto found = std::ranges::lower_bound(robot_time_us, time_us);
  return position_m.at(static_cast<std::size_t>(found - robot_time_us.begin()));
}

void PaperTest::boot_in(const std::string& fluid, bool has_default_sensor) {
  sim_robot::SimulatedRobotConfig config;
  config.boot_id = switched_off_.size() + 1;
  config.storage = &board;
  config.world.plant = sim_robot::fluid(fluid);
  config.world.seed = kSeed;
  if (has_default_sensor) config.world.imu.emplace();
  truth = {};
  swimmer = std::make_unique<VirtualRobot>(loop, clock, tasks, config);
  swimmer->on_tick = [this] {
    truth.robot_time_us.push_back(swimmer->simulated().robot_time_us());
    truth.position_m.push_back(swimmer->simulated().world().position_m());
  };
  swimmer->dial(robots);
  const auto is_there = [&] {
    const station::RobotState* known = station.find("sim-1");
    return known != nullptr && known->boot_id == config.boot_id && known->sample.has_value();
  };
  ASSERT_TRUE(clock.run_until(is_there, 10s));
}

void PaperTest::move_to(const std::string& fluid) {
  const bool has_default_sensor = swimmer->config().world.imu.has_value();
  swimmer->redial = false;
  swimmer->on_tick = {};
  swimmer->cut();
  switched_off_.push_back(std::move(swimmer));
  clock.run_for(5s);
  boot_in(fluid, has_default_sensor);
}

json PaperTest::get(const std::string& target) {
  const Answered answered = ask("GET", target);
  EXPECT_EQ(answered.status, 200) << target << ": " << answered.body;
  return answered.parsed();
}

json PaperTest::post(const std::string& target, const json& body) {
  const Answered answered = end(begin("POST", target, body), 40s);
  EXPECT_LT(answered.status, 300) << target << ": " << answered.body;
  return answered.parsed();
}

json PaperTest::computed(const json& request) {
  job_id_ = post("/api/v1/jobs", request).at("job_id");
  const json job = get(fmt::format("/api/v1/jobs/{}?wait_ms=9000", job_id_));
  EXPECT_EQ(job.at("state"), "done") << job;
  return job.at("result");
}

std::string PaperTest::name_fluid(const std::string& fluid) {
  return post(fmt::format("{}/fluid", kRobot), {{"fluid", fluid}}).at("model").at("state");
}

json PaperTest::begin_experiment(const std::string& profile) {
  return post("/api/v1/experiments", {{"robot_id", "sim-1"}, {"profile", profile}});
}

json PaperTest::await_experiment(const json& experiment, const std::string& state) {
  const std::string one = fmt::format("/api/v1/experiments/{}", experiment.at("experiment_id").get<int>());
  const std::int64_t ends_us = clock.steady_us() + kLongestExperiment.count();
  json now = get(one);
  const auto goes_on = [&] { return now.at("state") != state && now.at("ended_at_us").is_null(); };
  while (goes_on() && clock.steady_us() < ends_us) {
    ask("POST", one + "/keep-alive");
    clock.run_for(200ms);
    now = get(one);
  }
  EXPECT_EQ(now.at("state"), state) << now;
  return now;
}

std::uint64_t PaperTest::zeroed_at_us(std::uint64_t before_us) {
  std::uint64_t latest_us = 0;
  const std::string boot = std::to_string(swimmer->config().boot_id);
  const json commands = get(fmt::format("{}/commands?limit=1000", kRobot)).at("commands");
  for (const json& one : commands) {
    if (one.at("kind") != "zero_position" || one.at("boot_id") != boot) continue;
    const json& at_us = one.at("effect_at_robot_us");
    if (at_us.is_number() && at_us < before_us) latest_us = std::max(latest_us, at_us.get<std::uint64_t>());
  }
  EXPECT_GT(latest_us, 0U) << commands;
  return latest_us;
}

TrueStep PaperTest::true_step(const json& experiment, std::size_t step) {
  const json& steps = experiment.at("runs").back().at("steps");
  const auto begin_us = steps.at(step).at("robot_time_us").get<std::uint64_t>();
  const bool is_disturbance = steps.at(step).at("kind") == "disturbance";
  const double origin_m = truth.at(zeroed_at_us(steps.at(0).at("robot_time_us")));
  TrueStep out;
  std::vector<double> time_s;
  for (std::uint64_t at_us = begin_us; at_us < begin_us + static_cast<std::uint64_t>(kPhase_s * 1e6);
       at_us += kTickUs) {
    time_s.push_back(1e-6 * static_cast<double>(at_us - begin_us));
    out.position_m.push_back(truth.at(at_us) - origin_m);
  }
  // The disturbance shifts what the controller sees: the robot then moves by as much the other way.
  control::StepExperiment asked{0, kPhase_s, is_disturbance ? kSetpoint_m : 0,
                                is_disturbance ? kSetpoint_m - kDisturbance_m : kSetpoint_m, kBand_m};
  out.measured = control::measure_step(time_s, out.position_m, asked);
  asked.target_m = out.position_m.back();
  out.around_end = control::measure_step(time_s, out.position_m, asked);
  return out;
}

void PaperTest::import_truth(const json& experiment) {
  const json& of_run = experiment.at("runs").back();
  const std::string run = fmt::format("/api/v1/runs/{}", of_run.at("run_id").get<int>());
  const json samples = get(run + "/samples?limit=1");
  const std::uint64_t first_us = samples.at("samples").at(0).at("robot_time_us");
  const double origin_m = truth.at(zeroed_at_us(of_run.at("steps").at(0).at("robot_time_us")));
  std::string csv = "t_s,position_m\n";
  for (std::size_t i = 0; i < truth.position_m.size(); ++i) {
    if (truth.robot_time_us[i] < first_us) continue;
    csv += fmt::format("{:.2f},{:.7f}\n", 1e-6 * static_cast<double>(truth.robot_time_us[i] - first_us),
                       truth.position_m[i] - origin_m);
  }
  post(run + "/reference", {{"csv", csv},
                            {"source", "the simulated world"},
                            {"sd_m", 1e-6},
                            {"keep_zero", true},
                            {"clock", {{"method", "offset"}, {"offset_s", 0}}}});
}

}  // namespace server
