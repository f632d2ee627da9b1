#include "server/experiments/runner/conduct.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "server/analysis/control_json.hpp"
#include "server/experiments/runner/pump_flow.hpp"
#include "server/storage/experiments/experiment_store.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using nlohmann::json;

namespace {

constexpr microseconds kLook = 200ms, kModelWithin = 30s, kSamplesWithin = 3s;
constexpr double kWayBack_s = 15;  // for a robot to go back to where its run begins

json json_of(const Variant& variant) {
  return {{"fluid", variant.fluid.empty() ? json(nullptr) : json(variant.fluid)},
          {"controller", variant.controller.empty() ? json(nullptr) : json(variant.controller)},
          {"duty_factor", variant.duty_factor},
          {"setpoint_factor", variant.setpoint_factor},
          {"repeat", variant.repeat}};
}

std::string steps_json(const Profile& profile, const std::vector<StepBegin>& begins) {
  json list = json::array();
  for (const StepBegin& begin : begins) {
    list.push_back({{"step", begin.step + 1},
                    {"kind", step_kinds()[static_cast<std::size_t>(profile.steps[begin.step].kind)]},
                    {"robot_time_us", begin.robot_time_us}});
  }
  return list.dump();
}

// One setpoint, back to 0.
Profile way_back() {
  Profile profile;
  Step step;
  step.kind = StepKind::setpoint;
  step.setpoint_m = 0;
  step.for_s = kWayBack_s;
  profile.steps = {step};
  return profile;
}

}  // namespace

Conduct::Conduct(const ConductParts& parts, storage::Experiment experiment, Profile profile)
    : parts_{parts}, experiment_{std::move(experiment)}, profile_{std::move(profile)}, changed_{parts.driver.loop} {}

std::string Conduct::peer() const { return fmt::format("experiment:{}", experiment_.id); }

const station::RobotState& Conduct::robot() const {
  return *parts_.driver.station.find(experiment_.request.robot_id);  // a robot that is known stays known
}

asio::awaitable<std::optional<Abort>> Conduct::run() {
  boot_id_ = robot().boot_id;
  for (const Variant& variant : variants_of(profile_)) {
    ++number_;
    co_await one_run(variant);
    if (abort_) break;
  }
  co_return abort_;
}

asio::awaitable<void> Conduct::one_run(Variant variant) {
  co_await prepare(variant);
  if (abort_) co_return;
  auto make = [profile = profile_, variant] { return time_line_of(profile, variant); };
  TimeLine line = co_await parts_.maths.run(std::move(make));
  co_await begin_recording(variant, line);
  if (begun_.size() < number_) co_return;  // it did not come to a run
  begins_.clear();
  const DriveEnd end = co_await drive(std::move(line));
  if (end.abort) abort(*end.abort);
  if (!end.abort && end.rest != Rest::at_rest) abort({"not_at_rest", "the robot did not come to rest at its end"});
  co_await end_recording();
}

asio::awaitable<void> Conduct::end_after_failure() {
  abort({"internal", "the station could not go on with it; its log says why"});
  if (!begun_.empty() && !current().ended_at_us) co_await end_recording();
}

// --- before a run ---

asio::awaitable<void> Conduct::prepare(Variant variant) {
  co_await await_actor();
  if (!abort_) take_control();
  if (!abort_) co_await await_fluid(variant.fluid);
  if (!abort_ && number_ == 1) co_await await_flow();  // one flow for the whole grid
  if (!abort_ && !variant.controller.empty()) co_await send_controller(variant.controller);
  if (!abort_) co_await await_model();
  if (!abort_) co_await go_to_start();
}

bool Conduct::is_actor_there() const {
  const auto seen_us = parts_.driver.station.seen_us(experiment_.acts_for);
  return seen_us && parts_.driver.clock.steady_us() - *seen_us <= station::kOldestSight.count();
}

// SAFETY: nothing is prepared, and no control taken, for somebody who is not there; an unattended one goes on alone.
asio::awaitable<void> Conduct::await_actor() {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kAbsence.count();
  while (!abort_ && !experiment_.request.is_unattended && !is_actor_there()) {
    if (parts_.driver.clock.steady_us() > ends_us) {
      abort({"nobody_present", fmt::format("{} gives no sign of life", experiment_.acts_for)});
    }
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
}

// Paused by somebody while no driver is at work, or until the fluid is another one.
asio::awaitable<void> Conduct::await_resumption(microseconds limit) {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + limit.count();
  const bool was_paused = waiting_for_.has_value();
  while (!abort_ && waiting_for_ && !is_resumed_) {
    if (parts_.driver.clock.steady_us() > ends_us) abort({"paused_too_long", "nobody resumed it"});
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
  waiting_for_.reset();
  if (!abort_ && was_paused) co_await await_actor();
}

// SAFETY: just before the robot is moved.
void Conduct::check_robot() {
  if (abort_) return;
  if (robot().latched()) return abort({"emergency", "the robot is in emergency"});
  if (!is_at_rest(robot())) abort({"robot_not_at_rest", "the robot is not in manual at duty 0"});
}

// For the actor; an unattended one for as long as the robot may be alone.
void Conduct::take_control() {
  station::Station& station = parts_.driver.station;
  if (station.holder(experiment_.request.robot_id) == experiment_.acts_for && !experiment_.request.is_unattended)
    return;
  station::ControlRequest request;
  request.robot_id = experiment_.request.robot_id;
  request.actor = experiment_.acts_for;
  request.peer = peer();
  if (experiment_.request.is_unattended) request.lease = station::kLongestControl;
  const auto taken = station.control(request);
  if (!taken) abort({"control_of_another", taken.error().detail});
}

asio::awaitable<void> Conduct::await_fluid(std::string fluid) {
  if (!fluid.empty() && robot().fluid.empty()) {  // it says by it which one the robot is in, as a run does
    const station::Author by{experiment_.acts_for, peer(), parts_.driver.clock.utc_us()};
    const auto named = parts_.driver.station.set_fluid(experiment_.request.robot_id, fluid, by);
    if (!named) abort({"fluid", named.error().detail});
  }
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kFluidWithin.count();
  while (!abort_ && !fluid.empty() && !robot().fluid.empty() && robot().fluid != fluid) {
    is_resumed_ = false;  // SAFETY: who resumes it does so once the fluid is the right one
    waiting_for_ =
        Abort{"fluid", fmt::format("put the robot into '{}', say so, and resume; it is in '{}'", fluid, robot().fluid)};
    if (parts_.driver.clock.steady_us() > ends_us) abort(*waiting_for_);
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
  if (abort_ || !waiting_for_) co_return;
  co_await await_resumption();
  boot_id_ = robot().boot_id;  // it may have been switched off meanwhile
  if (!abort_) take_control();
}

// SAFETY: the station sets no pump, so nothing moves in a flow that nobody has confirmed; who resumes it confirms it.
asio::awaitable<void> Conduct::await_flow() {
  const auto last = co_await parts_.runs.last_flow(experiment_.request.robot_id);
  auto to_set = flow_to_set(profile_.conditions, last);
  if (abort_ || !to_set) co_return;
  is_resumed_ = false;
  waiting_for_ = Abort{"pump", std::move(*to_set)};
  co_await await_resumption(kFluidWithin);
  if (!abort_) take_control();
}

// The parameters of a model are set at rest only.
asio::awaitable<void> Conduct::await_model() {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kModelWithin.count();
  co_await parts_.driver.clock.sleep_for(kLook);  // it begins to be sent a little after the fluid was named
  while (!abort_ && robot().model.state == station::ModelState::sending) {
    if (parts_.driver.clock.steady_us() > ends_us) abort({"model", "the model of the fluid did not reach the robot"});
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
}

asio::awaitable<std::uint64_t> Conduct::submit(const char* what, protocol::Command command, std::string arguments) {
  station::CommandRequest request;
  request.robot_id = experiment_.request.robot_id;
  request.action = command;
  request.arguments = std::move(arguments);
  request.actor = experiment_.acts_for;
  request.peer = peer();
  request.takes_control = false;
  request.until_verified = command.which_action == rheonaut_Command_set_controller_tag;
  const auto sent = co_await parts_.driver.station.submit(std::move(request));
  if (sent && was_accepted(sent->state) && (sent->reason.empty() || sent->state == station::CommandState::verified)) {
    co_return sent->effect_at_robot_us;
  }
  const std::string why = sent ? fmt::format("{} {}", text(sent->state), sent->reason) : sent.error().detail;
  abort({"command_refused", fmt::format("{}: {}", what, why)});
  co_return 0;
}

asio::awaitable<void> Conduct::send_controller(std::string name) {
  const auto controller = co_await parts_.controller_by_name(name, experiment_.request.robot_id);
  if (!controller) {
    abort({"controller", fmt::format("controller '{}': {}", name, controller.error().detail)});
    co_return;
  }
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_controller_tag;
  command.action.set_controller = *controller;
  std::string arguments = json{{"name", name}}.dump();
  co_await submit("set_controller", command, std::move(arguments));
}

asio::awaitable<void> Conduct::go_to_start() {
  const bool goes_back = profile_.conditions.start == StartPosition::back && number_ > 1;
  if (goes_back) {
    TimeLine line = time_line_of(way_back(), {});
    const DriveEnd end = co_await drive(std::move(line));
    if (end.abort) abort(*end.abort);
    co_return;
  }
  if (profile_.conditions.start == StartPosition::here) co_return;
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_zero_position_tag;
  std::string no_arguments = "{}";
  const std::uint64_t zeroed_at_us = co_await submit("zero_position", command, std::move(no_arguments));
  co_await await_samples_from(zeroed_at_us);
}

// Samples of before may still be on their way. A run begins behind them, so that one zero holds for all of it: else no
// position that was measured from outside could be placed in it.
asio::awaitable<void> Conduct::await_samples_from(std::uint64_t robot_us) {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kSamplesWithin.count();
  while (!abort_ && sampled_until_us_ < robot_us) {
    if (parts_.driver.clock.steady_us() > ends_us) abort({"missing_samples", "no sample of after the zero arrived"});
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
}

// --- the run and its prediction ---

storage::RunConditions Conduct::conditions_of(const Variant& variant) const {
  storage::RunConditions conditions;
  const bool is_alone = experiment_.runs_planned == 1;
  conditions.name =
      is_alone ? profile_.name : fmt::format("{} ({} of {})", profile_.name, number_, experiment_.runs_planned);
  conditions.fluid = variant.fluid;
  conditions.pump_profile = pump_flows()[static_cast<std::size_t>(profile_.conditions.pump)];
  conditions.mean_flow_m_s = profile_.conditions.mean_flow_m_s;
  conditions.operator_name = experiment_.acts_for;
  conditions.profile = profile_.name;
  conditions.notes = experiment_.request.notes;
  return conditions;
}

asio::awaitable<void> Conduct::begin_recording(const Variant& variant, const TimeLine& line) {
  auto conditions = conditions_of(variant);
  station::Author by{experiment_.acts_for, peer(), 0};
  const auto run = co_await parts_.runs.create(experiment_.request.robot_id, std::move(conditions), std::move(by));
  if (!run) {
    abort({"run_refused", run.error().detail});
    co_return;
  }
  storage::ExperimentRun begun;
  begun.number = number_;
  begun.run = run->id;
  begun.variant = json_of(variant).dump();
  begun.started_at_us = parts_.driver.clock.utc_us();
  std::string prediction = co_await predict(line);
  begun.has_prediction = !prediction.empty();
  begun_.push_back(begun);
  auto add = [id = experiment_.id, begun, prediction = std::move(prediction)](storage::Database& database) {
    storage::add_experiment_run(database, id, begun, prediction);
  };
  co_await parts_.writer.keep("a run of an experiment", std::move(add));
}

// On the worker, since a long line takes its time. Empty where it cannot be computed.
asio::awaitable<std::string> Conduct::predict(const TimeLine& line) {
  const station::RobotSettings* settings = parts_.driver.station.settings(experiment_.request.robot_id);
  if (settings == nullptr || !settings->controller) co_return std::string{};
  const bool is_water = robot().fluid == "water";
  PredictionRequest request{profile_,
                            line,
                            is_water ? control::kNewtonianModel : control::kNonNewtonianModel,
                            is_water ? "(28)" : "(29)",
                            {},
                            *settings->controller};
  if (const station::FluidModel* in_use = parts_.fluid_models.in_force().find(robot().fluid)) {
    const json document = json::parse(in_use->document, nullptr, false);
    const json plant = document.is_object() ? document.value("plant", json()) : json();
    if (const auto model = analysis::model_from(plant)) {
      request.model = *model;
      request.model_of = robot().fluid;
      if (const auto known = analysis::uncertainty_from(plant)) request.uncertainty = *known;
    }
  }
  auto job = [request = std::move(request)]() -> std::string {
    try {
      return prediction_json(request);
    } catch (const std::invalid_argument& error) {
      return json{{"error", error.what()}}.dump();
    }
  };
  co_return co_await parts_.maths.run(std::move(job));
}

asio::awaitable<DriveEnd> Conduct::drive(TimeLine line) {
  co_await await_resumption();
  check_robot();
  if (abort_) co_return DriveEnd{abort_};
  DriveRequest request{experiment_.request.robot_id, experiment_.acts_for, peer(), experiment_.request.is_unattended};
  const station::RobotSettings* settings = parts_.driver.station.settings(request.robot_id);
  const auto limit_s = settings == nullptr ? std::nullopt : settings->parameters.value("auto_limit_s");
  if (limit_s) request.auto_limit = microseconds{static_cast<std::int64_t>(static_cast<double>(*limit_s) * 1e6)};
  driver_ = std::make_unique<RunDriver>(parts_.driver, std::move(request), profile_.abort, std::move(line));
  DriveEnd end = co_await driver_->run();
  begins_ = driver_->step_begins();
  driver_.reset();
  co_return end;
}

asio::awaitable<void> Conduct::end_recording() {
  storage::ExperimentRun& run = current();
  run.steps = steps_json(profile_, begins_);
  run.state = abort_ ? storage::ExperimentState::aborted : storage::ExperimentState::done;
  run.reason = abort_ ? abort_->reason : "";
  std::string verdict = abort_ ? fmt::format("aborted: {}", abort_->detail) : "done";
  station::Author by{experiment_.acts_for, peer(), 0};
  const auto ended = co_await parts_.runs.end(run.run.value_or(0), std::move(verdict), std::move(by));
  if (!ended && run.reason.empty()) run.reason = ended.error().reason;
  run.ended_at_us = parts_.driver.clock.utc_us();
  auto end = [id = experiment_.id, run](storage::Database& database) {
    storage::end_experiment_run(database, id, run);
  };
  co_await parts_.writer.keep("the end of a run of an experiment", std::move(end));
}

// --- by people, and the station's reports ---

// SAFETY: also between runs, and before the first one: then nothing moves until it is resumed.
void Conduct::pause(Abort why) {
  if (driver_) return driver_->pause(std::move(why.reason), std::move(why.detail));
  is_resumed_ = false;
  if (!waiting_for_) waiting_for_ = std::move(why);
}

void Conduct::resume() {
  is_resumed_ = true;
  if (driver_) driver_->resume();
  changed_.notify();
}

void Conduct::abort(Abort why) {
  if (!abort_) abort_ = std::move(why);
  if (driver_) driver_->abort(*abort_);
  changed_.notify();
}

void Conduct::set_actor(const std::string& actor) {
  experiment_.acts_for = actor;
  if (driver_) driver_->set_actor(actor);
}

const Abort* Conduct::pause_reason() const {
  if (waiting_for_) return &*waiting_for_;
  return driver_ ? driver_->pause_reason() : nullptr;
}

void Conduct::on_samples(const station::SampleBatch& batch) {
  if (driver_) return driver_->on_samples(batch);
  if (batch.samples.empty()) return;
  sampled_until_us_ = batch.first_robot_time_us + (batch.samples.size() - 1) * batch.context.period_us;
  changed_.notify();
}

// SAFETY: what was prepared is lost with the boot. While the fluid is changed the robot may be switched off.
void Conduct::on_robot(const station::RobotState& robot) {
  if (driver_) driver_->on_robot(robot);
  if (boot_id_ == 0 || (waiting_for_ && waiting_for_->reason == "fluid")) return;
  if (robot.boot_id != boot_id_) return abort({"reboot", "the robot has booted again"});
  if (robot.link != station::LinkState::connected) abort({"link_lost", "the link to the robot broke"});
}

void Conduct::on_command(const station::CommandRecord& record) {
  if (driver_) return driver_->on_command(record);
  if (auto found = disturbance_of(record, peer())) abort(std::move(*found));
}

}  // namespace server::experiments
