#include "server/experiments/runner/conduct.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/analysis/control_json.hpp"
#include "server/analysis/tuning/robot_controller.hpp"
#include "server/experiments/preview.hpp"
#include "server/storage/experiments/experiment_store.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using nlohmann::json;

namespace {

constexpr microseconds kDiskAgain = 1s, kLinkLook = 200ms;

bool may_pass(const Error& error) {
  return error.code == ErrorCode::unavailable || error.code == ErrorCode::not_connected;
}

json json_of(const Variant& variant) {
  return {{"fluid", variant.fluid.empty() ? json(nullptr) : json(variant.fluid)},
          {"controller", variant.controller.empty() ? json(nullptr) : json(variant.controller)},
          {"duty_factor", variant.duty_factor},
          {"setpoint_factor", variant.setpoint_factor},
          {"repeat", variant.repeat},
          {"step", variant.step == 0 ? json(nullptr) : json(variant.step)}};
}

std::string steps_json(const Profile& profile, std::size_t first_step, const std::vector<StepBegin>& begins) {
  json list = json::array();
  for (const StepBegin& begin : begins) {
    list.push_back({{"step", first_step + begin.step},
                    {"kind", step_kinds()[static_cast<std::size_t>(profile.steps[begin.step].kind)]},
                    {"robot_time_us", begin.robot_time_us}});
  }
  return list.dump();
}

}  // namespace

Conduct::Conduct(const ConductParts& parts, storage::Experiment experiment, Profile profile, const Life& life)
    : parts_{parts},
      experiment_{std::move(experiment)},
      profile_{std::move(profile)},
      life_{life},
      changed_{parts.driver.loop} {}

std::string Conduct::peer() const { return fmt::format("experiment:{}", experiment_.id); }

const station::RobotState& Conduct::robot() const {
  return *parts_.driver.station.find(experiment_.request.robot_id);  // a robot that is known stays known
}

asio::awaitable<std::optional<Abort>> Conduct::run() {
  boot_id_ = robot().boot_id;
  if (profile_.until) until_.emplace(profile_, parts_.fit_of_runs, parts_.maths);
  while (!abort_) {
    auto variant = co_await next_run();
    if (!variant || abort_) break;
    ++number_;
    co_await one_run(std::move(*variant));
  }
  co_return abort_;
}

asio::awaitable<std::optional<Variant>> Conduct::next_run() {
  if (!until_) {
    const std::vector<Variant> grid = variants_of(profile_);
    co_return number_ < grid.size() ? std::optional{grid[number_]} : std::nullopt;
  }
  check_same_fluid();
  if (abort_) co_return std::nullopt;
  std::vector<storage::RunId> runs;
  for (const storage::ExperimentRun& run : begun_) runs.push_back(run.run.value_or(0));
  if (!runs.empty()) activity_ = fmt::format("fitting a model to {} of its runs", runs.size());
  auto is_wanted = [this] { return !abort_.has_value(); };
  std::function<std::string()> actor = [this] { return experiment_.acts_for; };
  auto next = co_await until_->next(std::move(runs), std::move(actor), model_in_use().model, std::move(is_wanted));
  activity_.clear();
  if (!begun_.empty() && !until_->knowledge().is_null()) {
    current().knowledge = until_->knowledge().dump();
    auto note = [id = experiment_.id, run = current()](storage::Database& database) {
      storage::note_knowledge(database, id, run);
    };
    co_await parts_.writer.keep("what an experiment knows", std::move(note));
  }
  if (!next) {
    abort({next.error().reason, next.error().detail});
    co_return std::nullopt;
  }
  co_return *next;
}

const Conclusion* Conduct::conclusion() const {
  return until_ && until_->conclusion() ? &*until_->conclusion() : nullptr;
}

// With until one model is fitted to all runs, and a model is of one fluid.
void Conduct::check_same_fluid() {
  if (!until_ || begun_.empty() || robot().fluid == fluid_) return;
  abort({"fluid", fmt::format("the robot is in '{}' now, and was in '{}' in the first run", robot().fluid, fluid_)});
}

asio::awaitable<void> Conduct::one_run(Variant variant) {
  co_await prepare(variant);
  check_same_fluid();
  if (abort_) co_return;
  fluid_ = robot().fluid;
  of_run_ = profile_of_run(profile_, variant);
  first_step_ = std::max<std::size_t>(variant.step, 1);
  auto make = [profile = profile_, variant] { return time_line_of(profile, variant); };
  TimeLine line = co_await parts_.maths.run(std::move(make));
  co_await begin_recording(variant, line);
  if (begun_.size() < number_) co_return;  // it did not come to a run
  begins_.clear();
  const DriveEnd end = co_await drive(of_run_, std::move(line));
  if (end.abort) abort(*end.abort);
  if (!end.abort && end.rest != Rest::at_rest) abort({"not_at_rest", "the robot did not come to rest at its end"});
  co_await end_recording();
}

asio::awaitable<void> Conduct::end_after_failure() {
  abort({"internal", "the station could not go on with it; its log says why"});
  if (driver_) co_await driver_->settle_tasks();
  driver_.reset();
  if (!begun_.empty() && !current().ended_at_us) co_await end_recording();
}

// --- the run and its prediction ---

storage::RunConditions Conduct::conditions_of(const Variant& variant) const {
  storage::RunConditions conditions;
  const bool is_alone = experiment_.runs_planned == 1;
  conditions.name = is_alone ? profile_.name
                             : fmt::format("{} ({} of {}{})", profile_.name, number_, until_ ? "at most " : "",
                                           experiment_.runs_planned);
  conditions.fluid = variant.fluid;
  conditions.pump_profile = pump_flows()[static_cast<std::size_t>(profile_.conditions.pump)];
  conditions.mean_flow_m_s = profile_.conditions.mean_flow_m_s;
  conditions.operator_name = experiment_.acts_for;
  conditions.profile = profile_.name;
  conditions.notes = experiment_.request.notes;
  return conditions;
}

asio::awaitable<Result<storage::Run>> Conduct::create_run(const Variant& variant) {
  auto conditions = conditions_of(variant);
  station::Author by{experiment_.acts_for, peer(), 0};
  co_return co_await parts_.runs.create(experiment_.request.robot_id, std::move(conditions), std::move(by));
}

// A second; from ends_us on the experiment pauses. Returns the next ends_us.
asio::awaitable<std::int64_t> Conduct::await_disk(std::int64_t ends_us, std::string problem) {
  activity_ = "waiting for the disk, to begin its run";
  co_await parts_.driver.clock.sleep_for(kDiskAgain);
  if (parts_.driver.clock.steady_us() > ends_us) {  // SAFETY: nobody knows when it is back, and who is there then
    is_resumed_ = false;
    waiting_for_ = Abort{"not_recorded", std::move(problem)};
    co_await await_resumption(kFluidWithin);
    ends_us = parts_.driver.clock.steady_us() + parts_.driver.back_within.count();
  }
  co_await await_link();
  co_await await_actor();
  activity_.clear();
  co_return ends_us;
}

asio::awaitable<void> Conduct::begin_recording(const Variant& variant, const TimeLine& line) {
  auto run = co_await create_run(variant);
  std::int64_t ends_us = parts_.driver.clock.steady_us() + parts_.driver.back_within.count();
  while (!run && may_pass(run.error()) && !abort_) {
    ends_us = co_await await_disk(ends_us, run.error().detail);
    if (!abort_) run = co_await create_run(variant);
  }
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

// The model of the robot's fluid: the one that robots are sent, or the paper's.
Conduct::ModelInUse Conduct::model_in_use() const {
  const bool is_water = robot().fluid == "water";
  ModelInUse in_use{is_water ? control::kNewtonianModel : control::kNonNewtonianModel, is_water ? "(28)" : "(29)", {}};
  const station::FluidModel* stored = parts_.fluid_models.in_force().find(robot().fluid);
  if (stored == nullptr) return in_use;
  const json document = json::parse(stored->document, nullptr, false);
  const json plant = document.is_object() ? document.value("plant", json()) : json();
  const auto model = analysis::model_from(plant);
  if (!model) return in_use;
  in_use = {*model, robot().fluid, {}};
  if (const auto known = analysis::uncertainty_from(plant)) in_use.uncertainty = *known;
  return in_use;
}

// On the worker, since a long line takes its time. Empty where it cannot be computed.
asio::awaitable<std::string> Conduct::predict(const TimeLine& line) {
  const station::RobotSettings* settings = parts_.driver.station.settings(experiment_.request.robot_id);
  if (settings == nullptr || !settings->controller) co_return std::string{};
  ModelInUse in_use = model_in_use();
  PredictionRequest request{of_run_,
                            line,
                            in_use.model,
                            in_use.model_of,
                            in_use.uncertainty,
                            *settings->controller,
                            estimate_of(settings->parameters)};
  auto job = [request = std::move(request)]() -> std::string {
    try {
      return prediction_json(request);
    } catch (const std::invalid_argument& error) {
      return json{{"error", error.what()}}.dump();
    }
  };
  co_return co_await parts_.maths.run(std::move(job));
}

// On the worker. Without a model of the robot's fluid the paper's is taken, as for the prediction.
asio::awaitable<Result<void>> Conduct::check_travel(Profile profile, TimeLine rest, double position_m) {
  const station::RobotSettings* settings = parts_.driver.station.settings(experiment_.request.robot_id);
  const bool has_controller = settings != nullptr && settings->controller;
  if (!has_controller)
    co_return fail(ErrorCode::conflict, "what is left cannot be computed: its controller is not known");
  const auto duty_min = static_cast<double>(settings->controller->duty_min);
  const auto duty_max = static_cast<double>(settings->controller->duty_max);
  auto job = [duty_min, duty_max, profile = std::move(profile), rest = std::move(rest), model = model_in_use().model,
              sections = analysis::sections_of(*settings->controller), position_m]() -> Result<void> {
    try {
      const Preview left = preview_of(profile, rest, model, sections, duty_min, duty_max, position_m);
      if (left.problems.empty()) return {};
      return fail(ErrorCode::conflict, left.problems.front());
    } catch (const std::invalid_argument& error) {
      return fail(ErrorCode::conflict, fmt::format("what is left cannot be computed: {}", error.what()));
    }
  };
  co_return co_await parts_.maths.run(std::move(job));
}

// Also after the link was away: a robot without one comes to rest by itself.
asio::awaitable<void> Conduct::await_link() {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + parts_.driver.back_within.count();
  while (!abort_ && robot().link != station::LinkState::connected) {
    if (parts_.driver.clock.steady_us() > ends_us) abort({"link_lost", "the link to the robot broke"});
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLinkLook.count());
  }
}

asio::awaitable<DriveEnd> Conduct::drive(const Profile& profile, TimeLine line) {
  do {  // SAFETY: a pause that comes meanwhile holds it
    co_await await_resumption();
    co_await await_link();
  } while (!abort_ && waiting_for_);
  const bool is_there = experiment_.request.is_unattended || is_actor_there();
  if (!abort_ && is_there) take_control();  // it may have come into other hands meanwhile
  check_robot();
  if (abort_) co_return DriveEnd{abort_};
  DriveRequest request{experiment_.request.robot_id, experiment_.acts_for, experiment_.client, peer(),
                       experiment_.request.is_unattended};
  const station::RobotSettings* settings = parts_.driver.station.settings(request.robot_id);
  const auto limit_s = settings == nullptr ? std::nullopt : settings->parameters.value("auto_limit_s");
  if (limit_s) request.auto_limit = microseconds{static_cast<std::int64_t>(static_cast<double>(*limit_s) * 1e6)};
  const bool may_go_back = profile_.conditions.start == StartPosition::back && !request.is_unattended;
  if (may_go_back) request.way_back = time_line_of(way_back(), {});
  TravelCheck travel_check = [this, profile](TimeLine rest, double position_m) {
    return check_travel(profile, std::move(rest), position_m);
  };
  driver_ = std::make_unique<RunDriver>(parts_.driver, parts_.recorder, std::move(request), life_, profile_.abort,
                                        std::move(line), std::move(travel_check));
  DriveEnd end = co_await driver_->run();
  begins_ = driver_->step_begins();
  // SAFETY: a pause that came while the robot was brought to rest holds the next run.
  if (const Abort* why = driver_->held_by(); why != nullptr && !is_resumed_) waiting_for_ = *why;
  driver_.reset();
  co_return end;
}

asio::awaitable<void> Conduct::end_recording() {
  storage::ExperimentRun& run = current();
  run.steps = steps_json(of_run_, first_step_, begins_);
  run.state = abort_ ? storage::ExperimentState::aborted : storage::ExperimentState::done;
  run.reason = abort_ ? abort_->reason : "";
  std::string verdict = abort_ ? fmt::format("aborted: {}", abort_->detail) : "done";
  station::Author by{experiment_.acts_for, peer(), 0};
  activity_ = "storing the end of its run";
  const auto ended = co_await parts_.runs.end(run.run.value_or(0), std::move(verdict), std::move(by),
                                              storage::Runs::Patience::until_stored);
  activity_.clear();
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
  is_resumed_ = false;
  if (driver_) return driver_->pause(std::move(why.reason), std::move(why.detail));
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

void Conduct::set_client(const station::Client& client) {
  experiment_.acts_for = client.actor;
  experiment_.client = client.id;
  if (driver_) driver_->set_client(client);
}

const Abort* Conduct::pause_reason() const {
  if (waiting_for_) return &*waiting_for_;
  return driver_ ? driver_->pause_reason() : nullptr;
}

void Conduct::on_samples(const station::SampleBatch& batch) {
  if (driver_) return driver_->on_samples(batch);
  if (batch.samples.empty()) return;
  watch_latch(robot());
  sampled_until_us_ = batch.first_robot_time_us + (batch.samples.size() - 1) * batch.context.period_us;
  changed_.notify();
}

// Somebody puts the robot into another fluid, and resumes when that is done.
bool Conduct::is_in_hands() const { return waiting_for_ && waiting_for_->reason == "fluid"; }

// SAFETY: also between two runs, and also of a latch that is reset before the next: who stops the robot at the tube
// ends the experiment.
void Conduct::watch_latch(const station::RobotState& robot) {
  if (!robot.latched() || is_in_hands()) return;
  abort({"emergency", fmt::format("the robot is in emergency ({})", protocol::text(robot.context.emergency_cause))});
}

// SAFETY: what was prepared is lost with the boot. While the fluid is changed the robot may be switched off.
void Conduct::on_robot(const station::RobotState& robot) {
  if (driver_) driver_->on_robot(robot);
  if (!driver_) watch_latch(robot);
  if (boot_id_ == 0 || is_in_hands()) return;
  if (robot.boot_id != boot_id_) return abort({"reboot", "the robot has booted again"});
  changed_.notify();
}

void Conduct::on_event(const station::RobotEvent& event) {
  if (driver_) driver_->on_event(event);
}

void Conduct::on_command(const station::CommandRecord& record) {
  if (driver_) return driver_->on_command(record);
  const bool is_of_controller = record.kind == "set_controller" || record.kind == "restore_controller";
  if (waiting_for_ && waiting_for_->reason == kOtherController && is_of_controller) return;  // as they were asked to
  if (auto found = disturbance_of(record, peer())) abort(std::move(*found));
}

}  // namespace server::experiments
