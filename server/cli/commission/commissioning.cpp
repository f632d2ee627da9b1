// Each step asks the person, performs, judges, and says what it found.
#include "server/cli/commission/commissioning.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "base/failures/words.hpp"
#include "base/version.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr long kSensorFault = 8;  // of a sample's flags
constexpr double kUsPerMs = 1000;
constexpr std::array kInOrder{"versions", "stop_latency", "imu_noise",      "electrode",  "motor_direction",
                              "imu_axis", "dead_zone",    "motor_constant", "free_travel"};

double value_of(const json& parameters, const char* name, double other) {
  const json value = parameters.value(name, json());
  return value.is_number() ? value.get<double>() : other;
}

std::string lost_text(const StopAnswer& stop) {
  return stop.is_confirmed
             ? fmt::format(
                   "The robot is stopped: it confirmed after {:.1f} ms. It stays in emergency until somebody resets "
                   "it.",
                   stop.confirmed_ms)
             : "THE STOP IS NOT CONFIRMED: " + stop.why + ". SWITCH THE ROBOT OFF BY HAND.";
}

// Control of the robot, given back whatever happens.
class Control {
 public:
  Control(RobotAccess& robot, Person& person) : robot_{robot}, person_{person} {
    try {
      robot.take_control();
    } catch (...) {  // Ctrl-C, or an answer that is lost: it may have been given
      robot.release_control();
      throw;
    }
    person.while_asked([&robot] { robot.keep_control(); });
  }
  ~Control() {
    person_.while_asked({});
    robot_.release_control();
  }
  Control(const Control&) = delete;
  Control& operator=(const Control&) = delete;

 private:
  RobotAccess& robot_;
  Person& person_;
};

// Somebody else drives the robot: it must not be stopped for our sake.
struct NotOurs : std::runtime_error, base::failures::Worded {
  using runtime_error::runtime_error;
};

}  // namespace

void Commissioning::add(StepFinding finding) {
  person_.tell(fmt::format("{:<9}  {}: {}", text(finding.verdict), finding.step, finding.found));
  if (!finding.action.empty()) person_.tell("           to do: " + finding.action);
  record_.findings.push_back(std::move(finding));
}

void Commissioning::look_at_robot() {
  const json state = robot_.state(), station = robot_.station(), controller = robot_.controller();
  const json& latch = state.at("emergency_id");
  if (state.at("link") != "connected" || state.at("sample").is_null()) {
    throw std::runtime_error{fmt::format("the robot '{}' is not connected", record_.robot_id)};
  }
  if (!latch.is_null()) {
    throw std::runtime_error{"the robot is in emergency: find out why, reset it on the page, and begin again"};
  }
  if (state.at("mode") != "manual" || state.at("sample").at("duty") != 0.0) {
    throw std::runtime_error{"the robot is in use: bring it to rest in manual, and begin again"};
  }
  if (controller.is_null()) throw std::runtime_error{"the robot has not reported its controller yet; try again"};
  parameters_ = robot_.parameters();
  travel_.duty_max = value_of(controller, "duty_max", 1);
  plan_.is_one_way = value_of(controller, "duty_min", -1) >= 0;
  travel_.limit_min_m = value_of(parameters_, "position_limit_min_m", travel_.limit_min_m);
  travel_.limit_max_m = value_of(parameters_, "position_limit_max_m", travel_.limit_max_m);
  const json &status = state.at("status"), &path = state.at("stop_path");
  if (path.is_object() && path.at("round_trip_us").is_number()) {
    stops_.round_trip_ms = path.at("round_trip_us").get<double>() / kUsPerMs;
  }
  record_.subject = {{"firmware_version", state.at("firmware_version")},
                     {"station_version", station.at("version")},
                     {"program_version", base::version()},
                     {"store_id", station.at("store_id")},
                     {"boot_id", state.at("boot_id")},
                     {"peer", state.at("peer")},
                     {"controller_id", state.at("controller_id")},
                     {"controller_checksum", state.at("controller_checksum")},
                     {"parameters_checksum", state.at("parameters_checksum")},
                     {"fluid", state.at("fluid")},
                     {"model", state.at("model").at("state")}};
  VersionFacts versions{state.at("firmware_version").get<std::string>(), station.at("version").get<std::string>(),
                        base::version(), state.at("reset_cause").get<std::string>()};
  versions.has_status = status.is_object();
  if (versions.has_status) versions.imu_calibration = status.at("imu_calibration").get<long>();
  record_.plan = {
      {"largest_duty", plan_.largest_duty},
      {"one_way", plan_.is_one_way},
      {"stops", kStops},
      {"needed_m", needed_m(plan_)},
      {"profiles", {rest_profile(), pushes_profile(plan_), direction_profile(plan_), steps_profile(plan_)}}};
  for (const std::string& line : words_of(plan_)) person_.tell(line);
  add(judge_versions(versions));
}

// SAFETY: before the motor runs, and whichever way it will go.
void Commissioning::ask_for_room() {
  travel_.ahead_m =
      person_.length_m("free_ahead_m", "How far may it swim forwards from where it lies, by your ruler, in m?");
  travel_.behind_m = person_.length_m("free_behind_m", "And backwards, in m?");
  const double free_m = std::min(travel_.ahead_m, travel_.behind_m);
  if (free_m >= needed_m(plan_)) return;
  throw std::runtime_error{fmt::format(
      "there are {:.2f} m of free way, and {:.2f} m are needed ahead and behind: put the robot into the middle, "
      "or give less than --duty {:.2f}",
      free_m, needed_m(plan_), plan_.largest_duty)};
}

void Commissioning::stop_and_reset() {
  ++stops_.asked;
  const StopAnswer stop = robot_.stop();
  if (!stop.is_confirmed) throw std::runtime_error{fmt::format("stop {} is not confirmed: {}", stops_.asked, stop.why)};
  stops_.confirmed_ms.push_back(stop.confirmed_ms);
  robot_.reset(stop.emergency_id);
}

// SAFETY: the motor runs only after this.
void Commissioning::prove_stops() {
  person_.confirm(fmt::format("Begin with {} emergency stops? The motor stays off.", kStops));
  try {
    robot_.take_control();
    const json state = robot_.state();
    if (state.at("mode") != "manual" || state.at("sample").is_null() || state.at("sample").at("duty") != 0.0) {
      throw std::runtime_error{"it no longer rests in manual"};
    }
  } catch (const std::exception& error) {
    throw NotOurs{fmt::format("somebody else has the robot: {}", runtime::text_of(error))};
  }
  try {
    for (int i = 0; i < kStops; ++i) stop_and_reset();
  } catch (const std::exception& error) {
    stops_.not_confirmed = runtime::text_of(error);
    add(judge_stops(stops_));
    throw std::runtime_error{"the stops are not proved, so the motor must not run"};
  }
  add(judge_stops(stops_));
  travel_.worst_stop_ms = worst_stop_ms(stops_);
}

RecordedRun Commissioning::record_run(const json& profile) {
  RecordedRun run = robot_.perform(profile);
  record_.runs.push_back(run.reference);
  if (run.samples.empty()) throw std::runtime_error{"no samples of the run came: see to the link"};
  // Each run begins with a new zero, where the one before has ended.
  travel_.zero_m += last_end_.position_m;
  travel_.zero_sd_m = sum_of(travel_.zero_sd_m, last_end_.position_sd_m);
  last_end_ = run.samples.back();
  return run;
}

void Commissioning::measure_at_rest() {
  person_.confirm("Does it lie still in its fluid, the pump off, and nobody touches it?");
  const RecordedRun run = record_run(rest_profile());
  for (const RecordedSample& sample : run.samples) {
    rest_.acceleration_m_s2.push_back(sample.acceleration_m_s2);
    rest_.impedance_mv.push_back(sample.impedance_mv);
    rest_.has_sensor_fault = rest_.has_sensor_fault || (sample.flags & kSensorFault) != 0;
  }
  rest_.expected_noise_m_s2 = value_of(parameters_, "acceleration_noise_m_s2", rest_.expected_noise_m_s2);
  rest_.nominal_mv = value_of(parameters_, "impedance_nominal_mv", rest_.nominal_mv);
  rest_.band_mv = value_of(parameters_, "impedance_band_mv", rest_.band_mv);
  add(judge_imu_noise(rest_));
  add(judge_electrode(rest_));
}

void Commissioning::push() {
  const json profile = pushes_profile(plan_);
  person_.confirm(
      fmt::format("THE MOTOR RUNS NOW for the first time: pushes of duty {:.2f} to {:.2f}, {:.0f} s. Is the way "
                  "free?",
                  smallest_duty(plan_), plan_.largest_duty, duration_of(profile)));
  dead_zone_.is_one_way = plan_.is_one_way;
  dead_zone_.parameter = value_of(parameters_, "dead_zone_duty", 0);
  dead_zone_.tried = duties_in(profile);
  dead_zone_.responses = responses_of(record_run(profile).samples, sd_of(rest_.acceleration_m_s2));
  if (plan_.is_one_way) dead_zone_.backwards = robot_.try_duty(-smallest_duty(plan_));
}

void Commissioning::find_direction() {
  person_.confirm(fmt::format("Watch it: one push of duty {:+.2f} for 1 s. Is the way free?", direction_duty(plan_)));
  const RecordedRun run = record_run(direction_profile(plan_));
  const std::string word = person_.word("direction", "Which way did it move?", kDirections);
  direction_.person = word == "forwards"    ? SeenByPerson::forwards
                      : word == "backwards" ? SeenByPerson::backwards
                                            : SeenByPerson::nothing;
  direction_.response.duty = direction_duty(plan_);
  for (const Response& one : responses_of(run.samples, sd_of(rest_.acceleration_m_s2))) {
    if (one.duty > 0) direction_.response = one;
  }
  travel_.believed_m = run.samples.back().position_m;
  travel_.believed_sd_m = run.samples.back().position_sd_m;
  travel_.measured_m = person_.maybe_length_m(
      "moved_m",
      "How far did it move in this one push, from where it lay before it, by your ruler, in m, forwards positive? "
      "(Enter: not measured)");
  direction_.is_noise_sound = judge_imu_noise(rest_).verdict != Verdict::fail;
  add(judge_motor_direction(direction_));
  add(judge_imu_axis(direction_));
}

void Commissioning::judge_pushes() {
  if (direction_.response.edges() > 0 && direction_.person != SeenByPerson::nothing && !direction_.response.is_seen()) {
    return add(not_done("dead_zone", "the accelerometer sees no motion: its axis comes first"));
  }
  const StepFinding found = judge_dead_zone(dead_zone_);
  const auto zone = dead_zone_to_set(dead_zone_);
  if (found.verdict != Verdict::attention || !zone) return add(found);
  add(set_dead_zone(*zone, found));
}

// SAFETY: the zone that is set ends where the propeller stood still for certain; what may move the robot is doubtful.
StepFinding Commissioning::set_dead_zone(const DeadZoneToSet& zone, StepFinding found) {
  const double doubtful = std::max(zone.moving, value_of(parameters_, "doubtful_duty", 0));
  const std::string answer = person_.text(
      "set_dead_zone",
      fmt::format(
          "The accelerometer saw nothing at a duty of {:.2f} and motion at {:.2f}. If the propeller stood still "
          "at the first, type yes to set the robot's dead_zone_duty to {:.3f} and doubtful_duty to {:.3f} "
          "(Enter: leave them)",
          zone.still, zone.moving, zone.still, doubtful));
  if (answer != "yes") return found;
  if (const std::string problem = robot_.set_parameter("doubtful_duty", doubtful); !problem.empty()) {
    found.found += "; neither parameter was set: " + problem;
    return found;
  }
  const std::string done = fmt::format("; doubtful_duty was set to {:.3f}", doubtful);
  if (const std::string problem = robot_.set_parameter("dead_zone_duty", zone.still); !problem.empty()) {
    found.found += done + ", and dead_zone_duty was not: " + problem;
    return found;
  }
  dead_zone_.parameter = zone.still;
  StepFinding set = judge_dead_zone(dead_zone_);
  set.found += done + fmt::format(" and dead_zone_duty to {:.3f}", zone.still);
  return set;
}

void Commissioning::find_motor_constant() {
  // SAFETY: the steps go there and back, so only after the pushes have shown that the reverse reverses.
  const auto is_in_the_way = [](const StepFinding& one) {
    const bool is_wrong = one.verdict == Verdict::fail || one.verdict == Verdict::not_done;
    return is_wrong && (one.step == "motor_direction" || one.step == "imu_axis" || one.step == "dead_zone");
  };
  if (std::ranges::any_of(record_.findings, is_in_the_way)) {
    return add(
        not_done("motor_constant", "it means nothing before the motor's directions and the sensor's axis are right"));
  }
  person_.confirm(fmt::format("The last motion: four steps of duty {:.2f} for 1 s, {}. Is the way free?",
                              plan_.largest_duty, plan_.is_one_way ? "forwards" : "there and back"));
  const RecordedRun run = record_run(steps_profile(plan_));
  person_.tell("The station fits a model to the step ...");
  motor_.fit = robot_.fit(run.run_id, motor_.failure);
  add(judge_motor_constant(motor_));
}

void Commissioning::judge_travel() {
  travel_.gain_m_s = gain_of(motor_);
  add(judge_free_travel(travel_));
}

void Commissioning::complete() {
  for (const char* step : kInOrder) {
    const auto is_it = [step](const StepFinding& one) { return one.step == step; };
    if (std::ranges::none_of(record_.findings, is_it)) record_.findings.push_back(not_done(step, "not reached"));
  }
}

// SAFETY: whatever it was, the robot is stopped first.
void Commissioning::end_early(const std::string& why) {
  const StopAnswer stop = robot_.stop_and_end();
  record_.ended_by = why + (stop.is_confirmed ? "; the robot confirmed its stop" : "; THE STOP WAS NOT CONFIRMED");
  person_.tell("\nEnded: " + why + "\n" + lost_text(stop));
}

void Commissioning::perform() {
  prove_stops();
  measure_at_rest();
  push();
  find_direction();
  judge_pushes();
  find_motor_constant();
  judge_travel();
}

void Commissioning::run() {
  look_at_robot();
  ask_for_room();
  const Control control{robot_, person_};
  try {
    perform();
  } catch (const NotOurs&) {
    throw;
  } catch (const Interrupted&) {
    end_early("interrupted by a signal");
  } catch (const Declined&) {
    end_early("the person did not go on");
  } catch (const std::exception& error) {
    end_early(runtime::text_of(error));
  }
  complete();
}

}  // namespace server::cli
