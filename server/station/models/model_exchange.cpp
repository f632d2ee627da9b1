#include "server/station/models/model_exchange.hpp"

#include <fmt/format.h>

#include <utility>

#include "server/station/models/parameter_match.hpp"
#include "server/station/models/parameter_request.hpp"

namespace server::station {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kLook = 20ms;  // how often the robot's answer is looked for
constexpr microseconds kReadBackPatience = 2s;
constexpr microseconds kRestLook = 200ms;
constexpr microseconds kBusyPause = 100ms;  // the robot, or the queue to it, is full
constexpr microseconds kMovingPause = 1s;   // it coasts: its refusal says so

bool is_busy(const std::string& reason) { return reason == "queue_full" || reason == "busy"; }

std::unexpected<Error> refused(const std::string& name, float value, const Result<CommandRecord>& record) {
  if (!record) return std::unexpected{record.error()};
  return fail(ErrorCode::rejected, fmt::format("{} = {}: {}, {}", name, value, text(record->state), record->reason),
              record->reason);
}

}  // namespace

bool is_at_rest(const RobotState& robot) {
  return robot.context.mode != rheonaut_MODE_AUTO && (!robot.sample || robot.sample->duty == 0);
}

ModelExchange::ModelExchange(runtime::Clock& clock, ModelRobot& robot, FluidNaming naming)
    : clock_{clock}, robot_{robot}, naming_{std::move(naming)}, deadline_us_{clock.steady_us() + kPatience.count()} {}

asio::awaitable<Result<void>> ModelExchange::run() {
  if (!naming_.model) return take_back();
  return naming_.model->is_confirmed() ? send_model() : send_as_assumed();
}

// SAFETY: a robot takes a model that is in doubt for its own guess, and stays as unsure as a robot without one. What it
// held as confirmed is taken back before the first parameter changes.
asio::awaitable<Result<void>> ModelExchange::send_as_assumed() {
  Outcome done;
  if (robot_.confirmation() != false) done = co_await take_back();
  if (!done) co_return done;
  const std::optional<float> in_force = robot_.parameters().value(kModelSectionError);
  if (!in_force || *in_force < kAssumedSectionError) done = co_await set(kModelSectionError, kAssumedSectionError);
  if (done) done = co_await send_sections();
  co_return done;
}

asio::awaitable<Result<void>> ModelExchange::send_sections() {
  for (const auto& [name, value] : parameters_of(*naming_.model)) {
    const std::optional<float> in_force = robot_.parameters().value(name);
    if (in_force && is_same(*in_force, value)) continue;
    Outcome done = co_await set(name, value);
    if (!done) co_return done;
  }
  co_return Outcome{};
}

asio::awaitable<Result<void>> ModelExchange::send_model() {
  const Outcome sent = co_await send_sections();
  if (!sent) co_return sent;
  Outcome confirmed = co_await set(kModelConfirmed, 1);
  if (confirmed) confirmed = co_await wait_for_confirmation(true);
  if (confirmed && !holds(robot_.parameters(), *naming_.model)) {
    confirmed = fail(ErrorCode::conflict, "somebody changed a parameter of the model meanwhile", "differs");
  }
  co_return confirmed;
}

asio::awaitable<Result<void>> ModelExchange::take_back() {
  Outcome done = co_await set(kModelConfirmed, 0);
  if (done) done = co_await wait_for_confirmation(false);
  co_return done;
}

// Sends one parameter until the robot takes it, and reads it back.
asio::awaitable<Result<void>> ModelExchange::set(std::string name, float value) {
  for (;;) {
    const Outcome rests = co_await wait_for_rest();
    if (!rests) co_return rests;
    // SAFETY: what the robot reports counts, not what it was sent; each time, since it may change during a wait.
    if (name == kModelConfirmed && value == 1 && !holds(robot_.parameters(), *naming_.model)) {
      co_return fail(ErrorCode::conflict, "the robot's parameters are not the model's: somebody else changed one",
                     "differs");
    }
    CommandRequest request = set_parameter_request(robot_.state().id, naming_.by, name, value);
    const Result<CommandRecord> record = co_await robot_.submit(std::move(request));
    if (const Outcome wanted = check_wanted(); !wanted) co_return wanted;
    if (record && was_accepted(record->state)) break;
    const std::string reason = record ? record->reason : record.error().reason;
    const bool is_full = is_busy(reason);
    if (!is_full && reason != "motor_on") co_return refused(name, value, record);
    if (clock_.steady_us() >= deadline_us_) {
      const char* why = is_full ? "the robot takes no commands" : "the motor is on, or the robot coasts";
      co_return fail(ErrorCode::timed_out, why, reason);
    }
    co_await clock_.sleep_for(is_full ? kBusyPause : kMovingPause);
  }
  co_return co_await read_back(name, value);
}

// An accepted parameter is followed by a page with the value in force.
asio::awaitable<Result<void>> ModelExchange::read_back(std::string name, float value) {
  const std::int64_t deadline_us = clock_.steady_us() + kReadBackPatience.count();
  for (;;) {
    const std::optional<float> in_force = robot_.parameters().value(name);
    if (in_force && is_same(*in_force, value)) co_return Outcome{};
    if (clock_.steady_us() >= deadline_us) {
      const std::string said = in_force ? fmt::format("holds {}", *in_force) : "does not say what it holds";
      co_return fail(ErrorCode::conflict, fmt::format("{} = {} was sent, and the robot {}", name, value, said),
                     "differs");
    }
    co_await clock_.sleep_for(kLook);
  }
}

asio::awaitable<Result<void>> ModelExchange::wait_for_confirmation(bool is_confirmed) {
  const std::int64_t deadline_us = clock_.steady_us() + kReadBackPatience.count();
  while (robot_.confirmation() != is_confirmed) {
    if (clock_.steady_us() >= deadline_us) {
      co_return fail(ErrorCode::timed_out, "the robot's telemetry does not show it", "not_seen_in_telemetry");
    }
    co_await clock_.sleep_for(kLook);
  }
  co_return Outcome{};
}

asio::awaitable<Result<void>> ModelExchange::wait_for_rest() {
  for (;;) {
    const Outcome wanted = check_wanted();
    if (!wanted || is_at_rest(robot_.state())) co_return wanted;
    if (clock_.steady_us() >= deadline_us_) {
      co_return fail(ErrorCode::timed_out, "the motor is on; stop it and name the fluid again", "motor_on");
    }
    co_await clock_.sleep_for(kRestLook);
  }
}

Result<void> ModelExchange::check_wanted() const {
  if (robot_.latest_naming() != naming_.number) {
    return fail(ErrorCode::conflict, "another fluid was named meanwhile", "superseded");
  }
  const RobotState& robot = robot_.state();
  if (robot.boot_id != naming_.boot_id) {
    return fail(ErrorCode::conflict, "the robot has booted meanwhile; name its fluid again", "booted");
  }
  if (robot.link != LinkState::connected) {
    return fail(ErrorCode::not_connected, "the robot is not connected", "not_connected");
  }
  return {};
}

}  // namespace server::station
