// How a run is paused or interrupted, and goes on from where it was broken off.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/experiments/runner/run_driver.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr std::uint64_t kMostUndoneTicks = 200;  // a lost link is noticed within so long
constexpr std::uint64_t kMostAheadTicks = 100;   // more than a lease lasts
constexpr std::uint64_t kLongestLeaseUs = 600'000;

}  // namespace

// SAFETY: also while it is interrupted: then it does not go on by itself any more.
void RunDriver::pause(std::string reason, std::string detail) {
  ++rests_ordered_;
  pause_.emplace(Abort{std::move(reason), std::move(detail)}, parts_.clock.steady_us());
  changed_.notify();
}

// SAFETY: an unattended one ends; nobody sees that it goes on.
void RunDriver::interrupt(Abort why) {
  if (request_.is_unattended) return abort(std::move(why));
  const station::RobotState& robot = *parts_.station.find(request_.robot_id);
  const std::int64_t now_us = parts_.clock.steady_us();
  // It began with the last that was heard, also when this computer stood still since then.
  const bool is_of_link = why.reason != "nobody_present" && why.reason != "lease_lapsed";
  pause_for({std::move(why), is_of_link ? std::min(now_us, robot.last_received_steady_us) : now_us, true});
}

void RunDriver::pause_for(Pause pause) {
  ++rests_ordered_;
  // SAFETY: what is late on the way back takes no person's pause away.
  if (pause_ && !pause_->goes_back && (!pause_->ends_by_itself || pause.ends_by_itself)) return;
  pause_ = std::move(pause);
  changed_.notify();
}

void RunDriver::resume() {
  if (pause_) pause_->is_resumed = true;
  changed_.notify();
}

asio::awaitable<void> RunDriver::stay_paused() {
  // Not later than a lease lasts: this computer, too, may have been away.
  const station::RobotState& robot = *parts_.station.find(request_.robot_id);
  const std::uint64_t noticed_us = std::min(robot_now_us(robot), robot.latest_robot_time_us + kLongestLeaseUs);
  std::int64_t since_us = pause_->since_us;
  std::uint64_t tick = broken_off(noticed_us);
  paused_robot_us_ = feed_.robot_time_us(tick);
  const InterruptionNote note{*this, pause_->why};  // also where this is cancelled
  begin_generation();
  for (bool is_over = false; !is_over && !abort_;) {  // SAFETY: a pause that comes while the way is computed holds it
    co_await until_over_pause(noticed_us);
    const int losses = link_losses_;
    const bool was_to_make_room = makes_room_;
    tick = broken_off(noticed_us);  // samples of then may have come since
    paused_robot_us_ = feed_.robot_time_us(tick);
    if (!abort_) co_await check_travel(place_of(tick));
    const auto is_away = [&] {
      return losses != link_losses_ || parts_.station.find(request_.robot_id)->link != station::LinkState::connected;
    };
    // SAFETY: a person beside the robot expects the other direction.
    if (was_to_make_room != makes_room_) pause_->goes_on_at_us = 0;
    is_over = !abort_ && !is_away() && is_over_pause(*parts_.station.find(request_.robot_id), true);
    if (is_over && no_room_) abort(*no_room_);
    if (is_over && makes_room_ && !abort_) {
      is_over = false;
      broken_off_ = tick;
      count_wait(since_us);
      co_await go_back();
      since_us = pause_->since_us;
      pause_->goes_on_at_us = 0;
    }
    // SAFETY: who asked before the link was back, or the count-down of then, says nothing of now.
    if (is_away()) pause_->is_resumed = false, pause_->goes_on_at_us = 0;
  }
  if (!abort_) count_wait(since_us);
  if (!abort_ && pause_->ends_by_itself) count_interruption(place_of(tick));
  if (!abort_) go_on_from(place_of(tick));
}

// In closed loop, by the same rules as a step of the line, until the robot is at rest; what is late or speaks against
// it breaks it off.
asio::awaitable<void> RunDriver::go_back() {
  const int ordered = rests_ordered_;
  ++ways_back_;
  pause_->goes_back = true;
  pause_->goes_on_at_us = 0;
  pause_->shown.detail = fmt::format("{}; it goes back to 0, to make room for what is left", pause_->why.detail);
  begin_generation();
  wrong_mode_since_us_ = 0;
  const std::uint64_t begins_us =
      robot_now_us(*parts_.station.find(request_.robot_id)) + static_cast<std::uint64_t>(kBeginsAfter.count());
  way_feed_.emplace(*request_.way_back, 0, begins_us);
  for (;;) {
    const station::RobotState& robot = *parts_.station.find(request_.robot_id);
    if (ordered == rests_ordered_) {
      if (const auto& found = watch_.fault()) abort(*found);
      if (!abort_) watch_samples();
      if (!abort_) watch(robot);
    }
    const bool is_over = way_feed_->is_over(robot.latest_robot_time_us) && on_their_way_ == 0;
    if (abort_ || ordered != rests_ordered_ || is_over) break;
    feed(robot);
    co_await changed_.wait_until(parts_.clock, parts_.clock.steady_us() + kTurn.count());
  }
  begin_generation();
  co_await rest(true);
  way_feed_.reset();
  if (!pause_->goes_back) co_return;  // another pause
  pause_->goes_back = false;
  pause_->since_us = parts_.clock.steady_us();  // by now its client may be away for a while again
}

// The run goes on without a mark, but not its robot without a watch.
RunDriver::InterruptionNote::InterruptionNote(RunDriver& of, Abort why) : driver{of}, cause{std::move(why)} {
  try {
    of.parts_.station.note_pause(of.request_.robot_id, of.boot_id_, of.paused_robot_us_, cause.reason, cause.detail);
  } catch (const std::exception& error) {
    spdlog::error("the beginning of an interruption of a run is not noted: {}", runtime::text_of(error));
  }
}

RunDriver::InterruptionNote::~InterruptionNote() {
  driver.broken_off_.reset();
  try {
    driver.note_interruption(std::exchange(driver.paused_robot_us_, 0), cause);
  } catch (const std::exception& error) {
    spdlog::error("an interruption of a run is not noted: {}", runtime::text_of(error));
  }
  driver.pause_.reset();
}

// It lasts until the line goes on; one of no length, too, ends what was noted of its beginning.
void RunDriver::note_interruption(std::uint64_t from_robot_us, Abort cause) const {
  const station::RobotState& robot = *parts_.station.find(request_.robot_id);
  const bool is_of_now = robot.boot_id == boot_id_;  // else the robot has booted again, and its clock is another one
  const std::uint64_t now_us = is_of_now ? robot_now_us(robot) : seen_robot_us_;
  const std::uint64_t to_robot_us = abort_ ? now_us : std::max(now_us, feed_.begins_at_robot_us());
  const double length_s = static_cast<double>(std::max(to_robot_us, from_robot_us) - from_robot_us) / 1e6;
  if (pause_ && pause_->why.reason == cause.reason) cause = pause_->why;  // in the words of the end
  parts_.station.note_interruption(request_.robot_id, {boot_id_, from_robot_us, length_s}, cause.reason, cause.detail);
}

// Returns with the robot seen at rest by this boot since its link is there, or in emergency, or to be aborted.
asio::awaitable<void> RunDriver::until_over_pause(std::uint64_t noticed_us) {
  std::optional<Rest> resting;
  std::int64_t away_since_us = 0;
  while (!abort_) {
    const station::RobotState& robot = *parts_.station.find(request_.robot_id);
    const bool is_linked = robot.link == station::LinkState::connected;
    if (!is_linked) {
      resting.reset();
      pause_->is_resumed = false;  // SAFETY: it moves for nobody who asked before the link was back
      if (away_since_us == 0) away_since_us = parts_.clock.steady_us();
    } else if (!resting) {
      const Rest found = co_await rest(true);
      if (found == Rest::away) continue;
      resting = found;
      rested_at_us_ = parts_.clock.steady_us();
      if (found == Rest::at_rest) co_await check_travel(place_of(broken_off(noticed_us)));
      continue;
    }
    if (is_linked && away_since_us != 0) note_away(std::exchange(away_since_us, 0));
    if (!resting) pause_->goes_on_at_us = 0;
    if (is_over_pause(robot, resting.has_value())) {
      if (abort_ || resting != Rest::of_another) break;
      resting.reset();  // it is ours again; SAFETY: a pause that comes meanwhile holds it
      pause_->goes_on_at_us = 0;
      continue;
    }
    co_await changed_.wait_until(parts_.clock, parts_.clock.steady_us() + kTurn.count());
  }
  if (!abort_ && resting != Rest::at_rest) abort({"emergency", "the robot is in emergency"});
}

void RunDriver::note_away(std::int64_t since_us) {
  if (pause_->why.reason != "link_lost") return;
  const double away_s = static_cast<double>(parts_.clock.steady_us() - since_us) / 1e6;
  pause_->why.detail = pause_->shown.detail = fmt::format("the link to the robot was away for {:.1f} s", away_s);
}

// Where the motor was on last; what was commanded behind that has not been done, if it is not long ago. A robot that
// loses its link goes on for as long as its lease lasts.
std::uint64_t RunDriver::broken_off(std::uint64_t noticed_us) const {
  if (broken_off_) return *broken_off_;
  const std::uint64_t first = feed_.tick_at(0), noticed = feed_.tick_at(noticed_us);
  const std::uint64_t earliest = std::max(noticed - std::min(noticed, kMostUndoneTicks), first);
  const bool has_moved = driven_robot_us_ >= feed_.robot_time_us(first);
  const std::uint64_t driven = has_moved ? feed_.tick_at(driven_robot_us_) + 1 : first;
  return std::clamp(driven, earliest, std::min(noticed + kMostAheadTicks, line_.ticks));
}

// Where the line goes on: there, or in closed loop where these steps begin.
RunDriver::Place RunDriver::place_of(std::uint64_t tick) const {
  const auto after = std::ranges::upper_bound(line_.step_begins, tick);
  const auto step = static_cast<std::size_t>(after - line_.step_begins.begin()) - 1;
  if (!is_of_auto(line_, step)) return {step, tick};
  const std::size_t again = step_to_repeat(line_, step);
  return {again, line_.step_begins[again]};
}

// SAFETY: a line that is broken off begins from another place than it was planned from.
asio::awaitable<void> RunDriver::check_travel(Place place) {
  const station::RobotState& robot = *parts_.station.find(request_.robot_id);
  if (!robot.sample) co_return;
  const double position_m =
      static_cast<double>(robot.sample->position_m) - static_cast<double>(robot.context.disturbance_m.value_or(0));
  const TimeLine rest = rest_of(line_, place.step, place.tick);
  const Result<void> allowed = co_await travel_check_(rest, position_m);
  makes_room_ = !allowed && co_await has_room_from_0(rest, position_m);
  no_room_.reset();
  if (!allowed && !makes_room_) {
    no_room_ = Abort{"no_room", fmt::format("{}; going on from {:.3f} m, {}", pause_ ? pause_->why.detail : "",
                                            position_m, allowed.error().detail)};
  }
  if (pause_ && !pause_->ends_by_itself) {
    pause_->shown.detail =
        fmt::format("{}{}", pause_->why.detail, makes_room_ ? "; resumed, it goes back to 0 first" : "");
  }
}

asio::awaitable<bool> RunDriver::has_room_from_0(const TimeLine& rest, double position_m) {
  if (!request_.way_back || ways_back_ >= kMostBegins) co_return false;
  const Result<void> back = co_await travel_check_(*request_.way_back, position_m);
  if (!back) co_return false;
  const Result<void> allowed = co_await travel_check_(rest, 0);
  co_return allowed.has_value();
}

// A person's pause is no interruption.
void RunDriver::count_wait(std::int64_t since_us) {
  if (pause_->ends_by_itself) interrupted_us_ += pause_->goes_on_at_us - kCountDown.count() - since_us;
}

void RunDriver::count_interruption(Place place) {
  const std::uint64_t ends =
      place.step + 1 < line_.step_begins.size() ? line_.step_begins[place.step + 1] : line_.ticks;
  const double length_s = static_cast<double>(ends - line_.step_begins[place.step]) * kTick_s;
  const bool begins_again = is_of_auto(line_, place.step);
  const int most =
      begins_again ? kMostBegins - 1 : std::max(kMostBegins, static_cast<int>(length_s / kInterruptedEvery_s));
  if (++interruptions_[place.step] > most) {
    return abort({"too_many_repeats",
                  fmt::format("step {} was interrupted {} times; the last time: {}", line_.first_step + place.step,
                              interruptions_[place.step], pause_->why.detail)});
  }
  if (static_cast<double>(interrupted_us_) / 1e6 > line_.duration_s()) {
    abort({"too_many_repeats",
           fmt::format("it was interrupted for {:.1f} s in all, longer than it lasts itself; the last time: {}",
                       static_cast<double>(interrupted_us_) / 1e6, pause_->why.detail)});
  }
}

// The duty that was in force there is given again. A step whose time had come and that has not begun begins now.
void RunDriver::go_on_from(Place place) {
  const bool is_begun = is_of_auto(line_, place.step);
  std::erase_if(begins_, [&](const StepBegin& begin) {
    const std::uint64_t tick = line_.step_begins[begin.step];
    const bool is_of_this_generation = begin.robot_time_us >= feed_.robot_time_us(feed_.tick_at(0));
    return is_of_this_generation && (tick > place.tick || (tick == place.tick && !is_begun));
  });
  if (const auto in_force = duty_in_force(line_, place.step, place.tick)) {
    line_.actions.insert(std::ranges::upper_bound(line_.actions, place.tick, {}, &Action::tick), *in_force);
  }
  begin_at(place);
}

void RunDriver::check_pause_limit() {
  const std::int64_t paused_us = parts_.clock.steady_us() - pause_->since_us;
  const bool is_of_control = pause_->why.reason == "control_changed";
  if (pause_->goes_on_at_us != 0) return;
  const microseconds limit = pause_->ends_by_itself ? parts_.back_within
                             : is_of_control        ? kTakeOverWithin
                                                    : kLongestPause;
  if (paused_us <= limit.count()) return;
  if (pause_->ends_by_itself || is_of_control) return abort(pause_->why);
  abort({"paused_too_long", fmt::format("it was paused for {} s", limit / 1s)});
}

// SAFETY: it goes on only for somebody who is there now, and in control.
bool RunDriver::is_over_pause(const station::RobotState& robot, bool is_seen) {
  if (const auto& found = watch_.fault()) abort(*found);
  if (robot.latched()) abort({"emergency", "the robot is in emergency"});
  check_pause_limit();
  if (abort_) return true;
  watch_control();
  if (auto missing = unrecorded(robot)) {
    pause_for({std::move(*missing), parts_.clock.steady_us()});
    pause_->is_resumed = false;
    return false;
  }
  if (!is_seen) return false;
  if (pause_->ends_by_itself) return counts_down();
  return pause_->is_resumed && is_in_control() && (is_fresh() || request_.is_unattended);
}

// SAFETY: a sign of life that was given before the robot was seen at rest says nothing of going on.
bool RunDriver::counts_down() {
  const std::int64_t now_us = parts_.clock.steady_us();
  const bool is_there = is_fresh() && life_.seen_us.value_or(0) > rested_at_us_ && !watch_.late(now_us);
  if (!is_there || !has_control_again()) {
    pause_->goes_on_at_us = 0;
    pause_->shown = pause_->why;
    return false;
  }
  if (pause_->goes_on_at_us == 0) pause_->goes_on_at_us = now_us + kCountDown.count();
  const std::int64_t left_us = pause_->goes_on_at_us - now_us;
  pause_->shown.detail = fmt::format("{}; it {} in {} s unless it is paused", pause_->why.detail,
                                     no_room_      ? "ends, since what is left has no room,"
                                     : makes_room_ ? "goes back to 0, to make room for what is left,"
                                                   : "goes on",
                                     std::max<std::int64_t>(0, (left_us + 999'999) / 1'000'000));
  return left_us <= 0;
}

std::optional<double> RunDriver::goes_on_in_s() const {
  if (!pause_ || !pause_->ends_by_itself || pause_->goes_on_at_us == 0) return std::nullopt;
  return static_cast<double>(std::max<std::int64_t>(0, pause_->goes_on_at_us - parts_.clock.steady_us())) / 1e6;
}

// SAFETY: who takes control meanwhile, or gives it up while they are there, decides that nothing goes on by itself.
void RunDriver::watch_control() {
  if (is_in_control()) {
    has_lapsed_ = false;
    return;
  }
  const std::string holder = parts_.station.holder(request_.robot_id);
  const bool is_silent = !is_fresh();
  if (holder.empty() && is_silent) has_lapsed_ = true;
  if (holder.empty() && has_lapsed_) return;
  pause_for(
      {{"control_changed", holder.empty() ? "control of the robot was given up" : "control is with " + holder + " now"},
       parts_.clock.steady_us()});
}

// Its lease may have run out with the sign of life; SAFETY: what somebody else has taken is not taken back.
bool RunDriver::has_control_again() {
  if (is_in_control()) return true;
  if (!has_lapsed_ || !parts_.station.holder(request_.robot_id).empty()) return false;
  station::ControlRequest again;
  again.robot_id = request_.robot_id;
  again.actor = request_.actor;
  again.client = request_.client;
  again.peer = request_.peer;
  return parts_.station.control(again).has_value();
}

bool RunDriver::is_in_control() const {
  return parts_.station.holder(request_.robot_id) == request_.actor &&
         parts_.station.is_kept_by(request_.robot_id, {request_.actor, request_.client});
}

asio::awaitable<Rest> RunDriver::rest(bool ends_with_link) {
  RestRequest wanted{request_.robot_id, request_.actor, request_.peer, ends_with_link};
  co_return co_await bring_to_rest(parts_.station, parts_.clock, std::move(wanted));
}

// They end by themselves, since every command has a time to live; nothing of theirs is left when this returns.
asio::awaitable<void> RunDriver::settle_tasks() {
  while (on_their_way_ > 0) co_await parts_.clock.sleep_for(kTurn);
}

}  // namespace server::experiments
