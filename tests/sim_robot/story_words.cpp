// Steps both ends until a condition holds, and says what was the case when it has not.
#include "tests/sim_robot/story_words.hpp"

#include <algorithm>

#include "base/invalid_argument.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

constexpr double kHalfTickS = kTickS / 2;  // times are compared with this room for rounding
constexpr double kSetpointRoomM = 1e-4;    // of a float as large as setpoints may be
constexpr std::size_t kEventsShown = 12, kCommandsShown = 4;

bool is_for_the_motor(const protocol::Command& command) {
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag:
    case rheonaut_Command_set_setpoint_tag:
    case rheonaut_Command_set_duty_tag:
    case rheonaut_Command_set_duty_schedule_tag:
    case rheonaut_Command_emergency_stop_tag: return true;
    default: return false;
  }
}

// An event that there is not would never come, and expecting none would always hold.
void check_kind(std::string_view kind) {
  for (int each = _rheonaut_EventKind_MIN; each <= _rheonaut_EventKind_MAX; ++each) {
    if (kind == protocol::text(static_cast<protocol::EventKind>(each))) return;
  }
  base::throw_invalid("there is no event '", kind, "'; docs/protocol.md has their kinds");
}

std::string seconds(double value_s) { return short_text(value_s) + " s"; }

}  // namespace

void StoryWords::forget() {
  events_.clear();
  was_expected_.clear();
  given_.clear();
  is_driving_ = false;
}

void StoryWords::tick() {
  step();
  if (!is_driving_) return;
  const double now_s = moment().time_s;
  if (now_s < renewed_at_s_ + kRenewalS - kHalfTickS) return;
  renewed_at_s_ = now_s;
  give(renew_lease());
}

void StoryWords::pass(double seconds) {
  const double end_s = moment().time_s + seconds;
  while (moment().time_s < end_s - kHalfTickS) tick();
}

double StoryWords::await(const Condition& condition, Limit limit, Where where) {
  const double begin_s = moment().time_s;
  for (Moment now = moment(); !condition.holds(now); now = moment()) {
    if (now.time_s >= begin_s + limit.limit_s - kHalfTickS) {
      fail("awaited for " + seconds(limit.limit_s) + ": " + condition.text(), condition.account(now), where);
    }
    tick();
  }
  return moment().time_s - begin_s;
}

void StoryWords::expect(const Condition& condition, Where where) {
  const Moment now = moment();
  if (!condition.holds(now)) fail("expected now: " + condition.text(), condition.account(now), where);
}

void StoryWords::holds(const Condition& condition, For duration, Where where) {
  const double begin_s = moment().time_s;
  for (Moment now = moment();; now = moment()) {
    const double passed_s = now.time_s - begin_s;
    if (!condition.holds(now)) {
      fail("expected to hold for " + seconds(duration.for_s) + ": " + condition.text(),
           "after " + seconds(passed_s) + " " + condition.account(now), where);
    }
    if (passed_s >= duration.for_s - kHalfTickS) return;
    tick();
  }
}

std::optional<std::size_t> StoryWords::find_event(std::string_view kind, std::size_t from) const {
  for (std::size_t i = from; i < events_.size(); ++i) {
    const bool is_answered = i < was_expected_.size() && was_expected_[i];
    if (!is_answered && events_[i].kind == kind) return i;
  }
  return std::nullopt;
}

std::size_t StoryWords::take_event(std::string_view kind, std::size_t from, double until_s) {
  check_kind(kind);
  std::optional<std::size_t> found;
  while (!(found = find_event(kind, from)) && moment().time_s < until_s - kHalfTickS) tick();
  if (!found) return events_.size();
  was_expected_.resize(events_.size());
  was_expected_[*found] = true;
  return *found;
}

ReceivedEvent StoryWords::expect_event(std::string_view kind, Within within, Where where) {
  const std::size_t found = take_event(kind, 0, moment().time_s + within.within_s);
  if (found < events_.size()) return events_[found];
  fail("expected within " + seconds(within.within_s) + ": event " + std::string(kind), "none came", where);
}

void StoryWords::expect_events(std::initializer_list<std::string_view> kinds, Within within, Where where) {
  const double until_s = moment().time_s + within.within_s;
  std::size_t from = 0;
  for (const std::string_view kind : kinds) {
    const std::size_t found = take_event(kind, from, until_s);
    if (found == events_.size()) {
      const std::string order = from > 0 ? " after " + events_[from - 1].kind : "";
      fail("expected within " + seconds(within.within_s) + ": event " + std::string(kind) + order, "none came", where);
    }
    from = found + 1;
  }
}

void StoryWords::expect_no_event(std::string_view kind, Where where) {
  check_kind(kind);
  const auto found = find_event(kind, 0);
  if (!found) return;
  fail("expected none: event " + std::string(kind), "one came at " + seconds(events_[*found].robot_time_s), where);
}

Sent StoryWords::send(const protocol::Command& command) {
  if (is_for_the_motor(command)) is_driving_ = false;
  const std::uint64_t id = give(command);
  given_.push_back({id, protocol::kind(command)});
  return {*this, id};
}

void StoryWords::go_to(double setpoint_m, Where where) {
  const bool is_in_auto = in_auto().holds(moment());
  const auto target_m = static_cast<float>(setpoint_m);
  send(is_in_auto ? set_setpoint(target_m) : set_auto(target_m)).expect_accepted({}, where);
  await(in_auto() and setpoint().within(kSetpointRoomM).of(setpoint_m), {}, where);
}

Answer StoryWords::stop(Where where) {
  const Answer answer = send(emergency_stop()).expect_accepted({}, where);
  await(in_emergency() and motor_off(), {}, where);
  return answer;
}

Answer StoryWords::clear(Where where) {
  const Answer answer = send(clear_emergency(moment().received.emergency_id)).expect_accepted({}, where);
  await(in_manual(), {}, where);
  return answer;
}

void StoryWords::drive(const Drive& drive, Where where) {
  start_driving(drive.duty, where);
  pass(drive.for_s);
  let_go(where);
}

void StoryWords::start_driving(double duty, Where where) {
  const Sent order = send(set_duty(static_cast<float>(duty)));
  renewed_at_s_ = moment().time_s;
  is_driving_ = true;
  order.expect_accepted({}, where);
  if (duty != 0) await(motor_on(), {}, where);
}

void StoryWords::let_go(Where where) {
  send(set_duty(0)).expect_accepted({}, where);
  await(motor_off(), {}, where);
}

Answer StoryWords::await_answer(std::uint64_t id, Limit limit, Where where) {
  const double end_s = moment().time_s + limit.limit_s;
  while (!answer_to(id)) {
    if (moment().time_s >= end_s - kHalfTickS) {
      fail("awaited for " + seconds(limit.limit_s) + ": an answer to " + kind_of(id), "none came", where);
    }
    tick();
  }
  return *answer_to(id);
}

void StoryWords::fail(const std::string& what, const std::string& instead, Where where) const {
  const Moment now = moment();
  throw StoryFailed(base::join_text(where.file_name(), ":", where.line(), ": ", what, "\n  instead   ", instead,
                                    "\n  at        ", seconds(now.time_s), " of the story\n  received  ",
                                    text(now.received), "\n  in truth  ", text(now.truth), "\n  events    ",
                                    events_text(), "\n  commands  ", commands_text()));
}

std::string StoryWords::events_text() const {
  const std::size_t first = events_.size() - std::min(events_.size(), kEventsShown);
  std::string text = first > 0 ? "…" : "";
  for (std::size_t i = first; i < events_.size(); ++i) {
    text += (text.empty() ? "" : ", ") + events_[i].kind + " " + seconds(events_[i].robot_time_s);
  }
  return text.empty() ? "none" : text;
}

std::string StoryWords::commands_text() const {
  const std::size_t first = given_.size() - std::min(given_.size(), kCommandsShown);
  std::string text = first > 0 ? "…" : "";
  for (std::size_t i = first; i < given_.size(); ++i) {
    const auto answer = answer_to(given_[i].id);
    text += (text.empty() ? "" : ", ") + given_[i].kind + " " + (answer ? answer->text : "unanswered");
  }
  return text.empty() ? "none" : text;
}

const std::string& StoryWords::kind_of(std::uint64_t command_id) const {
  return std::ranges::find(given_, command_id, &Given::id)->kind;
}

Answer Sent::answer(Limit limit, Where where) const { return story_.await_answer(id_, limit, where); }

Answer Sent::expect_accepted(Limit limit, Where where) const {
  const Answer answer = story_.await_answer(id_, limit, where);
  if (answer.text == "accepted") return answer;
  story_.fail("expected: " + story_.kind_of(id_) + " accepted", "the answer is " + answer.text, where);
}

Answer Sent::expect_refused(std::string_view reason, Limit limit, Where where) const {
  const Answer answer = story_.await_answer(id_, limit, where);
  if (answer.text == reason) return answer;
  story_.fail("expected: " + story_.kind_of(id_) + " refused as " + std::string(reason), "the answer is " + answer.text,
              where);
}

}  // namespace sim_robot
