// One coroutine for each robot that something is sent to; run() for what robots report by themselves.
// LONG: what is sent, and what robots report of it, share each robot's state and are understood together.
#include "server/station/model_sender.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_text.hpp"

namespace server {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr const char* kConfirmed = "model_confirmed";
constexpr microseconds kLook = 20ms;  // how often the robot's answer is looked for
constexpr microseconds kReadBackPatience = 2s;
constexpr microseconds kRestLook = 200ms;
constexpr microseconds kBusyPause = 100ms;   // the robot, or the queue to it, is full
constexpr microseconds kMovingPause = 1s;    // it coasts: its refusal says so
constexpr microseconds kJudgePatience = 5s;  // for the parameters of a robot that has connected
constexpr microseconds kDebtInterval = 1s;

bool same_bits(float a, float b) { return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b); }

bool is_confirmed(std::uint32_t flags) { return (flags & rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED) != 0; }

bool is_at_rest(const RobotState& robot) {
  return robot.context.mode != rheonaut_MODE_AUTO && (!robot.sample || robot.sample->duty == 0);
}

CommandRequest set_parameter(const RobotId& id, const Author& by, const std::string& name, float value) {
  CommandRequest request;
  request.robot_id = id;
  request.actor = by.actor;
  request.peer = by.peer;
  request.takes_control = false;  // SAFETY: who named the fluid may be gone by now
  request.action = rheonaut_Command_init_zero;
  request.action.which_action = rheonaut_Command_set_parameter_tag;
  auto& parameter = request.action.action.set_parameter;
  std::strncpy(parameter.name, name.c_str(), sizeof parameter.name - 1);
  parameter.value = value;
  request.arguments = nlohmann::json{{"name", name}, {"value", base::decimal(value)}}.dump();
  return request;
}

RobotModel model_state(ModelState state, const std::string& fluid, const std::optional<FluidModel>& model,
                       std::string reason) {
  RobotModel out;
  out.state = state;
  out.fluid = fluid;
  out.reason = std::move(reason);
  if (model) {
    out.fit_error = model->fit_error;
    out.set_at_us = model->set_at_us;
  }
  return out;
}

std::string fluid_words(const std::string& fluid) {
  return fluid.empty() ? "a fluid that is not known" : fmt::format("'{}'", fluid);
}

Error no_longer(std::string why) { return {ErrorCode::conflict, std::move(why), "superseded"}; }

}  // namespace

ModelSender::ModelSender(asio::io_context& loop, TaskGroup& tasks, Clock& clock, Station& station,
                         const FluidModelList& models)
    : loop_{loop}, tasks_{tasks}, clock_{clock}, station_{station}, models_{models}, wake_{loop_} {
  station.add_sink(*this);
  station.set_on_fluid_named([this](const RobotState& robot, const Author& by) { on_fluid_named(robot, by); });
  tasks.spawn("models of fluids", run());
}

// SAFETY: what was confirmed for another fluid is owed from here on, whatever becomes of the new model.
void ModelSender::on_fluid_named(const RobotState& robot, const Author& by) {
  Place& place = places_[robot.id];
  const FluidModel* model = models_.find(robot.fluid);
  const bool is_connected = robot.link == LinkState::connected;
  const bool is_in_sight = is_connected && place.boot_id == robot.boot_id && place.flag && !place.at_work;
  const bool may_be_confirmed = robot.boot_id != 0 && (!is_in_sight || *place.flag);
  const bool is_this = is_in_sight && *place.flag && robot.model.state == ModelState::confirmed &&
                       robot.model.fluid == robot.fluid && !robot.fluid.empty();
  place.naming = {place.naming.number + 1, by, robot.boot_id, robot.fluid,
                  model == nullptr ? std::nullopt : std::optional{*model}};
  if (model != nullptr && is_this && holds(robot.id, *model)) return;
  const bool is_to_be_taken_back = model == nullptr || !is_this;
  place.owes = place.owes || (may_be_confirmed && is_to_be_taken_back);
  if (place.owes) open_.insert(robot.id);
  wake_.notify();
  if (model == nullptr && !place.at_work && (!place.owes || !is_in_sight)) {
    return station_.set_model(robot.id, only_assumed(robot.fluid));  // run() settles the debt when telemetry comes
  }
  if (is_connected) return begin(robot.id, place);
  const Naming naming = place.naming;
  conclude(robot.id, naming,
           fail(ErrorCode::not_connected, "the robot was not connected; name the fluid again", "not_connected"));
}

RobotModel ModelSender::only_assumed(const std::string& fluid) const {
  std::string why;
  if (models_.find(fluid) != nullptr) {
    why = "name the fluid again to send its model";
  } else if (!fluid.empty()) {
    why = fmt::format("there is no model of '{}'", fluid);
  }
  return model_state(ModelState::assumed, "", {}, std::move(why));
}

void ModelSender::begin(const RobotId& id, Place& place) {
  const Naming& naming = place.naming;
  const std::string why = naming.model ? "" : "what was confirmed before is taken back";
  station_.set_model(id, model_state(ModelState::sending, naming.model ? naming.fluid : "", naming.model, why));
  if (std::exchange(place.at_work, true)) return;  // the task goes on with this naming
  tasks_.spawn("model of a robot's fluid", work(id));
}

asio::awaitable<void> ModelSender::work(RobotId id) {
  for (;;) {
    const Naming naming = places_[id].naming;
    Outcome outcome = fail(ErrorCode::internal, "a fault of the station; its log says which", "internal");
    auto sending = carry_out(id, naming, outcome);
    co_await alone(id, std::move(sending));
    Place& place = places_[id];
    if (place.naming.number != naming.number) continue;  // somebody has named another since
    place.at_work = false;
    auto finishing = finish(id, naming, outcome);
    co_await alone(id, std::move(finishing));
    co_return;
  }
}

asio::awaitable<void> ModelSender::alone(RobotId id, asio::awaitable<void> task) {
  return contained(tasks_.exceptions(), clock_, Ended::model, fmt::format("the model of robot '{}'", id),
                   std::move(task));
}

// The outcome stays as it is when this fails inside.
asio::awaitable<void> ModelSender::carry_out(RobotId id, Naming naming, Outcome& outcome) {
  if (naming.model) {
    outcome = co_await send_model(id, naming);
  } else {
    outcome = co_await take_back(id, naming);
  }
}

asio::awaitable<void> ModelSender::finish(RobotId id, Naming naming, Outcome outcome) {
  conclude(id, naming, outcome);
  co_return;
}

void ModelSender::conclude(const RobotId& id, const Naming& naming, const Outcome& outcome) {
  Place& place = places_[id];
  place.next_try_us = clock_.steady_us() + kRetryInterval.count();
  if (!outcome) return conclude_failure(id, naming, outcome.error());
  place.owes = false;
  place.reported_failure.clear();
  if (naming.model) {
    station_.set_model(id, model_state(ModelState::confirmed, naming.fluid, naming.model, ""));
    station_.note_model(id, "model_confirmed", fmt::format("{} by {}", naming.fluid, naming.by.actor));
  } else {
    station_.set_model(id, only_assumed(naming.fluid));
    station_.note_model(id, "model_taken_back", fmt::format("the robot is in {}", fluid_words(naming.fluid)));
  }
}

void ModelSender::conclude_failure(const RobotId& id, const Naming& naming, const Error& error) {
  Place& place = places_[id];
  if (error.reason == "booted") {  // follow() says so
    place.owes = false;
    return;
  }
  // SAFETY: what was confirmed before is not this fluid's, and what was sent in part is nobody's.
  place.owes = place.owes || place.flag.value_or(true);
  if (place.owes) open_.insert(id);
  wake_.notify();
  RobotModel failed = model_state(ModelState::failed, naming.model ? naming.fluid : "", naming.model, error.detail);
  if (!naming.model) failed.reason = fmt::format("what was confirmed before is not taken back yet: {}", error.detail);
  const bool is_news = std::exchange(place.reported_failure, failed.reason) != failed.reason;  // not each retry
  station_.set_model(id, failed);
  if (naming.model) {
    const std::string what = fmt::format("the model of '{}' could not be sent: {}", naming.fluid, error.detail);
    spdlog::warn("robot '{}': {}", id, what);
    station_.note_model(id, "model_not_confirmed", what);
  } else if (is_news) {
    spdlog::warn("robot '{}': the model: {}", id, failed.reason);
    station_.note_model(id, "model_not_taken_back", failed.reason);
  }
}

asio::awaitable<ModelSender::Outcome> ModelSender::send_model(RobotId id, Naming naming) {
  const std::int64_t deadline_us = clock_.steady_us() + kPatience.count();
  for (const auto& [name, value] : parameters_of(*naming.model)) {
    const std::optional<float> in_force = station_.parameter_in_force(id, name);
    if (in_force && same_bits(*in_force, value)) continue;
    Outcome done = co_await set(id, naming, name, value, deadline_us);
    if (!done) co_return done;
  }
  Outcome confirmed = co_await set(id, naming, kConfirmed, 1, deadline_us);
  if (confirmed) confirmed = co_await wait_for_flag(id, true);
  if (confirmed && !holds(id, *naming.model)) {
    confirmed = fail(ErrorCode::conflict, "somebody changed a parameter of the model meanwhile", "differs");
  }
  co_return confirmed;
}

asio::awaitable<ModelSender::Outcome> ModelSender::take_back(RobotId id, Naming naming) {
  const std::int64_t deadline_us = clock_.steady_us() + kPatience.count();
  Outcome done = co_await set(id, naming, kConfirmed, 0, deadline_us);
  if (done) done = co_await wait_for_flag(id, false);
  co_return done;
}

// Sends one parameter until the robot takes it, and reads it back.
asio::awaitable<ModelSender::Outcome> ModelSender::set(RobotId id, Naming naming, std::string name, float value,
                                                       std::int64_t deadline_us) {
  for (;;) {
    const Outcome rests = co_await wait_for_rest(id, naming, deadline_us);
    if (!rests) co_return rests;
    // SAFETY: what the robot reports counts, not what it was sent; each time, since it may change during a wait.
    if (name == kConfirmed && value == 1 && !holds(id, *naming.model)) {
      co_return fail(ErrorCode::conflict, "the robot's parameters are not the model's: somebody else changed one",
                     "differs");
    }
    CommandRequest request = set_parameter(id, naming.by, name, value);
    const Result<CommandRecord> record = co_await station_.submit(std::move(request));
    if (const Outcome wanted = still_wanted(id, naming); !wanted) co_return wanted;
    if (record && was_accepted(record->state)) break;
    const std::string reason = record ? record->reason : record.error().reason;
    const bool is_busy = reason == "queue_full" || reason == "busy";
    if (!is_busy && reason != "motor_on") {
      if (!record) co_return std::unexpected{record.error()};
      co_return fail(ErrorCode::rejected, fmt::format("{} = {}: {}, {}", name, value, text(record->state), reason),
                     reason);
    }
    if (clock_.steady_us() >= deadline_us) {
      const char* why = is_busy ? "the robot takes no commands" : "the motor is on, or the robot coasts";
      co_return fail(ErrorCode::timed_out, why, reason);
    }
    co_await clock_.sleep_for(is_busy ? kBusyPause : kMovingPause);
  }
  co_return co_await read_back(id, name, value);
}

// An accepted parameter is followed by a page with the value in force.
asio::awaitable<ModelSender::Outcome> ModelSender::read_back(RobotId id, std::string name, float value) {
  const std::int64_t deadline_us = clock_.steady_us() + kReadBackPatience.count();
  for (;;) {
    const std::optional<float> in_force = station_.parameter_in_force(id, name);
    if (in_force && same_bits(*in_force, value)) co_return Outcome{};
    if (clock_.steady_us() >= deadline_us) {
      const std::string said = in_force ? fmt::format("holds {}", *in_force) : "does not say what it holds";
      co_return fail(ErrorCode::conflict, fmt::format("{} = {} was sent, and the robot {}", name, value, said),
                     "differs");
    }
    co_await clock_.sleep_for(kLook);
  }
}

asio::awaitable<ModelSender::Outcome> ModelSender::wait_for_flag(RobotId id, bool flag) {
  const std::int64_t deadline_us = clock_.steady_us() + kReadBackPatience.count();
  while (places_[id].flag != flag) {
    if (clock_.steady_us() >= deadline_us) {
      co_return fail(ErrorCode::timed_out, "the robot's telemetry does not show it", "not_seen_in_telemetry");
    }
    co_await clock_.sleep_for(kLook);
  }
  co_return Outcome{};
}

// Of what the station knows; the robot itself may still coast.
asio::awaitable<ModelSender::Outcome> ModelSender::wait_for_rest(RobotId id, Naming naming, std::int64_t deadline_us) {
  for (;;) {
    Outcome wanted = still_wanted(id, naming);
    if (!wanted || is_at_rest(*station_.find(id))) co_return wanted;
    if (clock_.steady_us() >= deadline_us) {
      co_return fail(ErrorCode::timed_out, "the motor is on; stop it and name the fluid again", "motor_on");
    }
    co_await clock_.sleep_for(kRestLook);
  }
}

ModelSender::Outcome ModelSender::still_wanted(const RobotId& id, const Naming& naming) const {
  if (places_.at(id).naming.number != naming.number)
    return std::unexpected{no_longer("another fluid was named meanwhile")};
  const RobotState& robot = *station_.find(id);
  if (robot.boot_id != naming.boot_id) {
    return fail(ErrorCode::conflict, "the robot has booted meanwhile; name its fluid again", "booted");
  }
  if (robot.link != LinkState::connected) {
    return fail(ErrorCode::not_connected, "the robot is not connected", "not_connected");
  }
  return {};
}

bool ModelSender::holds(const RobotId& id, const FluidModel& model) const {
  for (const auto& [name, value] : parameters_of(model)) {
    const std::optional<float> in_force = station_.parameter_in_force(id, name);
    if (!in_force || !same_bits(*in_force, value)) return false;
  }
  return true;
}

// What the robot has said so far speaks against it.
bool ModelSender::holds_another(const RobotId& id, const FluidModel& model) const {
  for (const auto& [name, value] : parameters_of(model)) {
    const std::optional<float> in_force = station_.parameter_in_force(id, name);
    if (in_force && !same_bits(*in_force, value)) return true;
  }
  return false;
}

// A sink never calls the station: run() does.
void ModelSender::on_robot(const RobotState& robot) {
  const auto found = places_.find(robot.id);
  if (found == places_.end()) return;
  // SAFETY: of a command that was on its way when the link broke nobody knows whether it has run.
  if (robot.link == LinkState::disconnected) found->second.flag.reset();
  if (found->second.boot_id == robot.boot_id) return;
  changed_.insert(robot.id);
  wake_.notify();
}

void ModelSender::on_samples(const RobotState& robot, const SampleBatch& batch) {
  if (batch.next_seq() != robot.next_seq) return;  // sent again: it is not what holds now
  Place& place = places_[robot.id];
  const bool flag = is_confirmed(batch.context.flags);
  if (place.boot_id == robot.boot_id && place.flag == flag) return;
  if (place.boot_id != robot.boot_id) {
    place.boot_id = robot.boot_id;
    place.flag.reset();
    place.page_before_seq = 0;
  }
  place.was_seen_to_rise = place.flag.has_value();
  place.flag = flag;
  place.heard_first_us = clock_.steady_us();
  changed_.insert(robot.id);
  wake_.notify();
}

void ModelSender::on_in_force(const RobotState& robot, const InForceRecord& record) {
  const auto found = places_.find(robot.id);
  if (record.kind != "parameters" || found == places_.end()) return;
  found->second.page_before_seq = record.first_seq;
  found->second.page_came_us = clock_.steady_us();
  changed_.insert(robot.id);
  wake_.notify();
}

asio::awaitable<void> ModelSender::run() {
  for (;;) {
    if (changed_.empty() && open_.empty()) {
      co_await wake_.wait();
    } else if (changed_.empty()) {
      co_await wake_.wait_until(clock_, clock_.steady_us() + kDebtInterval.count());
    }
    std::set<RobotId> robots = std::exchange(changed_, {});
    robots.insert(open_.begin(), open_.end());
    for (const RobotId& id : robots) {
      auto looking = look_at(id);
      co_await alone(id, std::move(looking));
    }
  }
}

asio::awaitable<void> ModelSender::look_at(RobotId id) {
  const RobotState* robot = station_.find(id);
  if (robot != nullptr) follow(*robot, places_[id]);
  co_return;
}

// Compares what the robot reports now with what is known of it.
void ModelSender::follow(const RobotState& robot, Place& place) {
  open_.erase(robot.id);
  if (place.naming.boot_id != robot.boot_id && place.naming.boot_id != 0) {
    place.naming.boot_id = 0;
    place.owes = false;  // a boot takes every confirmation back
    const std::string why = robot.fluid.empty() ? "" : "the robot has booted: name its fluid again";
    station_.set_model(robot.id, model_state(ModelState::assumed, "", {}, why));
  }
  if (place.at_work || place.boot_id != robot.boot_id || !place.flag) {
    if (place.owes) open_.insert(robot.id);
    return;
  }
  if (place.owes) return settle_debt(robot, place);
  const bool is_taken_for_confirmed = robot.model.state == ModelState::confirmed;
  // The flag may have fallen and risen between two samples, or while the robot was away.
  const std::optional<FluidModel>& sent = place.naming.model;
  const bool is_another =
      is_taken_for_confirmed && !robot.model.fluid.empty() && sent && holds_another(robot.id, *sent);
  const bool is_flag_old = is_flag_older_than_page(robot, place);
  if (is_flag_old) open_.insert(robot.id);
  if (is_taken_for_confirmed && (!*place.flag || (is_another && is_flag_old))) {
    return station_.set_model(
        robot.id, model_state(ModelState::assumed, "", {}, "the robot has taken it back: a parameter was changed"));
  }
  if (*place.flag && !is_flag_old && (!is_taken_for_confirmed || is_another)) judge_unseen(robot, place);
}

// The page of a changed parameter comes before the sample that shows what the change has done to the confirmation.
bool ModelSender::is_flag_older_than_page(const RobotState& robot, const Place& place) const {
  const bool is_waited_for = clock_.steady_us() < place.page_came_us + kJudgePatience.count();
  return robot.next_seq <= place.page_before_seq && is_waited_for;
}

// A confirmation that did not come from here.
void ModelSender::judge_unseen(const RobotState& robot, Place& place) {
  const FluidModel* model = models_.find(robot.fluid);
  if (model != nullptr && holds(robot.id, *model)) {
    place.naming.boot_id = robot.boot_id;
    place.naming.fluid = robot.fluid;
    place.naming.model = *model;  // SAFETY: other bits under the flag are noticed by it
    return station_.set_model(robot.id, model_state(ModelState::confirmed, robot.fluid, *model, ""));
  }
  if (place.was_seen_to_rise) {  // somebody has commanded it
    place.naming.boot_id = robot.boot_id;
    return station_.set_model(robot.id, model_state(ModelState::confirmed, "", {}, "by a command, and of no fluid"));
  }
  open_.insert(robot.id);
  const bool is_reported = station_.parameter_in_force(robot.id, kConfirmed).has_value();
  if (model != nullptr && !is_reported && clock_.steady_us() < place.heard_first_us + kJudgePatience.count()) return;
  // SAFETY: nobody here knows for which fluid it was confirmed.
  place.naming = {place.naming.number + 1, {"station:model", "", 0}, robot.boot_id, robot.fluid, std::nullopt};
  place.owes = true;
  place.next_try_us = 0;
  station_.set_model(robot.id,
                     model_state(ModelState::failed, "", {}, "what was confirmed before is not taken back yet"));
}

// SAFETY: nobody's hands are taken from the robot for it: it waits for rest, and until nobody else is in control.
void ModelSender::settle_debt(const RobotState& robot, Place& place) {
  if (!*place.flag) {
    place.owes = false;
    if (robot.model.state == ModelState::failed && robot.model.fluid.empty()) {
      station_.set_model(robot.id, only_assumed(robot.fluid));
    }
    return;
  }
  open_.insert(robot.id);
  const std::string& holder = robot.control.holder;
  const bool is_free = holder.empty() || holder == place.naming.by.actor;
  const bool is_ready = robot.link == LinkState::connected && is_at_rest(robot) && is_free;
  if (!is_ready || clock_.steady_us() < place.next_try_us) return;
  Naming& naming = place.naming;
  naming = {naming.number + 1, naming.by, robot.boot_id, robot.fluid, std::nullopt};
  begin(robot.id, place);
}

}  // namespace server
