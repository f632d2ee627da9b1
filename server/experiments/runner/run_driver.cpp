#include "server/experiments/runner/run_driver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "server/experiments/runner/order_arguments.hpp"
#include "server/station/commands/pending_command.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kWrongModeFor = 400ms;  // telemetry comes later than the time of a command
constexpr microseconds kShortestStall = 2s;    // of recording; a commit on a busy machine takes less
constexpr microseconds kLatelyWithin = 3s;     // a standstill of this computer explains what is late now
constexpr double kMmOfOneM = 1e3;
constexpr microseconds kRenewsEvery = 120ms;  // a lease lasts 500 ms

// Commands of which a run knows nothing, and that change what it measures.
constexpr std::array<std::string_view, 9> kDisturbing{"drop_timed",    "set_mode",          "set_setpoint",
                                                      "set_duty",      "set_duty_schedule", "inject_disturbance",
                                                      "zero_position", "set_controller",    "restore_controller"};

Abort link_lost() { return {"link_lost", "the link to the robot broke"}; }

}  // namespace

RunDriver::RunDriver(const DriverParts& parts, const storage::Recorder& recorder, DriveRequest request,
                     const Life& life, const AbortCriteria& criteria, TimeLine line, TravelCheck travel_check)
    : parts_{parts},
      recorder_{recorder},
      request_{std::move(request)},
      life_{life},
      line_{std::move(line)},
      watch_{criteria, parts.clock.steady_us()},
      feed_{line_, 0, 0},
      travel_check_{std::move(travel_check)},
      changed_{parts.loop} {}

std::uint64_t RunDriver::robot_now_us(const station::RobotState& robot) const {
  return static_cast<std::uint64_t>(station::robot_now_us(robot, parts_.clock));
}

void RunDriver::begin_at(Place place) {
  const station::RobotState* robot = parts_.station.find(request_.robot_id);
  begin_generation();
  wrong_mode_since_us_ = 0;
  const bool is_its_begin = place.tick <= line_.step_begins.at(place.step);
  next_begin_ = is_its_begin ? place.step : place.step + 1;
  feed_ = CommandFeed{line_, place.step, robot_now_us(*robot) + static_cast<std::uint64_t>(kBeginsAfter.count()),
                      place.tick};
}

void RunDriver::begin_generation() {
  ++generation_;
  accepted_.clear();
  generation_robot_us_ = robot_now_us(*parts_.station.find(request_.robot_id));
}

asio::awaitable<DriveEnd> RunDriver::run() {
  const station::RobotState* robot = parts_.station.find(request_.robot_id);
  if (robot == nullptr) co_return DriveEnd{Abort{"unknown_robot", "the robot is not known"}, Rest::latched};
  boot_id_ = robot->boot_id;
  began_robot_us_ = robot_now_us(*robot);
  begin_at({});
  co_await run_until_end();
  begin_generation();
  const Rest at_the_end = co_await rest(false);
  co_await settle_tasks();
  co_return DriveEnd{abort_, at_the_end};
}

asio::awaitable<void> RunDriver::run_until_end() {
  for (;;) {
    const station::RobotState& robot = *parts_.station.find(request_.robot_id);
    if (const auto& found = watch_.fault()) abort(*found);
    if (!abort_ && !pause_) watch_samples();
    if (!abort_ && !pause_) watch(robot);
    if (abort_) co_return;
    if (pause_) {
      co_await stay_paused();
      continue;
    }
    feed(robot);
    renew_lease();
    note_steps(robot_now_us(robot));
    if (feed_.is_over(robot.latest_robot_time_us) && on_their_way_ == 0) co_return;  // as telemetry shows
    co_await changed_.wait_until(parts_.clock, parts_.clock.steady_us() + kTurn.count());
  }
}

// --- what speaks against going on ---

void RunDriver::watch_samples() {
  auto late = watch_.late(parts_.clock.steady_us());
  if (!late) return;
  if (late->reason == "gap") return interrupt(std::move(*late));
  abort(std::move(*late));
}

void RunDriver::watch(const station::RobotState& robot) {
  if (robot.latched()) {
    return abort(
        {"emergency", fmt::format("the robot is in emergency ({})", protocol::text(robot.context.emergency_cause))});
  }
  if (auto missing = unrecorded(robot)) return pause_for({std::move(*missing), parts_.clock.steady_us()});
  watch_mode(robot);
  watch_actor(robot);
}

// SAFETY: nothing moves for a record that is not made. The other half of the robot's ring is for the disk to come back.
std::optional<Abort> RunDriver::unrecorded(const station::RobotState& robot) const {
  const microseconds half_a_ring{std::int64_t{robot.ring_capacity} * robot.sample_period_us / 2};
  const microseconds missing = recorder_.not_recording_for();
  if (missing < std::max(half_a_ring, kShortestStall)) return std::nullopt;
  const std::string& problem = recorder_.problem();
  return Abort{"not_recorded",
               fmt::format("nothing has been recorded for {:.1f} s: {}", static_cast<double>(missing.count()) / 1e6,
                           problem.empty() ? "the disk does not answer" : problem)};
}

void RunDriver::watch_mode(const station::RobotState& robot) {
  const std::int64_t now_us = parts_.clock.steady_us();
  const bool lapsed = (robot.context.flags & rheonaut_TELEMETRY_FLAG_LEASE_LAPSED) != 0;
  if (lapsed && feed_now().needs_lease(robot.latest_robot_time_us)) {
    return interrupt({"lease_lapsed", "the lease of the duty was not renewed in time"});
  }
  if (robot.context.mode == feed_now().mode_at(robot.latest_robot_time_us)) {
    wrong_mode_since_us_ = 0;
    return;
  }
  if (wrong_mode_since_us_ == 0) wrong_mode_since_us_ = now_us;
  if (now_us - wrong_mode_since_us_ <= kWrongModeFor.count()) return;
  abort({"mode_left", fmt::format("the robot is in the mode {} and was to be in {}", protocol::text(robot.context.mode),
                                  protocol::text(feed_now().mode_at(robot.latest_robot_time_us)))});
}

// SAFETY: nobody's motor runs while they are away, and nobody's but that of who is in control.
void RunDriver::watch_actor(const station::RobotState& robot) {
  const std::int64_t now_us = parts_.clock.steady_us(), silent_us = life_.silent_for_us(now_us);
  const std::string holder = parts_.station.holder(request_.robot_id);
  if (!is_in_control() && !holder.empty()) {
    const char* whose = holder == request_.actor ? "another page or program of " : "";
    return pause_for({{"control_changed", fmt::format("control is with {}{} now", whose, holder)}, now_us});
  }
  if (request_.is_unattended) {
    if (silent_us <= request_.auto_limit.count() && !holder.empty()) return;
    return abort({"unattended_limit", fmt::format("nobody was there for {} s", request_.auto_limit / 1s)});
  }
  if (holder.empty() && is_fresh()) return abort({"control_changed", "control of the robot was given up"});
  if (silent_us > kAbsence.count() || holder.empty()) {
    has_lapsed_ = holder.empty();
    return interrupt(
        {"nobody_present", fmt::format("{} has given no sign of life for {} s", request_.actor, kAbsence / 1s)});
  }
  const std::uint64_t robot_us = robot_now_us(robot);
  const bool is_driving = feed_now().needs_lease(robot_us) || feed_now().is_about_to_drive(robot_us);
  if (!is_driving || is_fresh()) return;
  interrupt({"nobody_present", fmt::format("{} gives no sign of life", request_.actor)});
}

void RunDriver::on_samples(const station::SampleBatch& batch) {
  watch_.on_samples(batch, parts_.clock.steady_us());
  const bool is_of_auto = batch.context.mode == rheonaut_MODE_AUTO;
  if (batch.boot_id == boot_id_ && !batch.samples.empty()) {
    const std::uint64_t last_us = batch.first_robot_time_us + (batch.samples.size() - 1) * batch.context.period_us;
    seen_robot_us_ = std::max(seen_robot_us_, last_us);
  }
  for (std::size_t k = 0; k < batch.samples.size(); ++k) {
    const std::uint64_t made_us = batch.first_robot_time_us + k * batch.context.period_us;
    if (is_of_auto || batch.samples[k].duty != 0) driven_robot_us_ = std::max(driven_robot_us_, made_us);
  }
  // It has come to rest by itself, also where the station has not lost it.
  const bool was_alone = (batch.context.flags & rheonaut_TELEMETRY_FLAG_LINK_LOSS) != 0;
  if (was_alone && batch.first_robot_time_us > generation_robot_us_) interrupt(link_lost());
  changed_.notify();
}

void RunDriver::on_robot(const station::RobotState& robot) {
  if (boot_id_ == 0) return;
  if (robot.boot_id != boot_id_) return abort({"reboot", "the robot has booted again"});
  if (robot.link == station::LinkState::connected) return;
  ++link_losses_;
  interrupt(link_lost());
}

std::optional<Abort> disturbance_of(const station::CommandRecord& record, const std::string& peer) {
  if (record.peer == peer || record.actor.starts_with("station")) return std::nullopt;
  if (record.kind == "emergency_stop") {
    return Abort{"emergency_stop", fmt::format("{} has stopped the robot", record.actor)};
  }
  const bool is_new = record.acknowledged_after_us < 0 && record.ended_at_us == 0;
  if (!is_new || std::ranges::find(kDisturbing, record.kind) == kDisturbing.end()) return std::nullopt;
  return Abort{"operator_command", fmt::format("{} has sent {}", record.actor, record.kind)};
}

void RunDriver::on_command(const station::CommandRecord& record) {
  if (record.peer == request_.peer) return on_own_command(record);
  if (auto found = disturbance_of(record, request_.peer)) abort(std::move(*found));
}

void RunDriver::on_own_command(const station::CommandRecord& record) {
  if (!accepted_.contains(record.id)) return;
  auto fault = fault_of(record);
  if (!fault) return;
  if (is_late(record)) return interrupt(came_late(record.kind));
  abort(std::move(*fault));
}

// A late command is given again when the robot has been seen at rest.
Abort RunDriver::came_late(const std::string& kind) const {
  const microseconds stood = parts_.clock.watch().stood_still_within(kLatelyWithin, parts_.clock.steady_us());
  const std::string cause =
      stood.count() == 0 ? "" : fmt::format(": this computer stood still for {} ms", stood.count() / 1000);
  return {"command_late", fmt::format("{} came to the robot too late{}", kind, cause)};
}

// SAFETY: the robot has ended its motion by itself and is in manual, as it was, so that somebody looks; the next step
// of the line would move it again.
void RunDriver::on_event(const station::RobotEvent& event) {
  const bool is_of_now = event.boot_id == boot_id_ && event.robot_time_us >= began_robot_us_;
  if (!is_of_now || event.kind != "position_uncertain") return;
  abort({"position_uncertain",
         fmt::format("the robot has stopped by itself: it knows its position to ± {:.0f} mm (2 sd), too little for how "
                     "near a position limit is",
                     kMmOfOneM * static_cast<double>(event.value))});
}

void RunDriver::abort(Abort why) {
  if (!abort_) abort_ = std::move(why);
  changed_.notify();
}

// --- what is sent ---

void RunDriver::feed(const station::RobotState& robot) {
  CommandFeed& feed = way_feed_ ? *way_feed_ : feed_;
  const std::uint64_t now_us = robot_now_us(robot);
  // What comes after a change of mode is sent once telemetry shows it.
  if (robot.context.mode != feed.mode_at(now_us)) return;
  while (auto fed = feed.next(now_us)) {
    spawn(send(std::move(*fed), now_us));
  }
}

// What it throws ends the task alone; what it was to do is missed, and shows in telemetry.
void RunDriver::spawn(asio::awaitable<void> task) {
  parts_.tasks.spawn(request_.peer, runtime::contained(parts_.tasks.exceptions(), parts_.clock,
                                                       runtime::Ended::experiment, request_.peer, std::move(task)));
}

station::CommandRequest RunDriver::request_of(const protocol::Command& command) const {
  station::CommandRequest request;
  request.robot_id = request_.robot_id;
  request.action = command;
  request.actor = request_.actor;
  request.client = request_.client;
  request.peer = request_.peer;
  request.answer_grace = station::kOwnAnswerGrace;
  request.takes_control = false;  // SAFETY: a program is no sign of life of its operator
  return request;
}

asio::awaitable<void> RunDriver::send(FedCommand fed, std::uint64_t robot_now_us) {
  const runtime::Counted one_more{on_their_way_};
  const int generation = generation_;
  station::CommandRequest request = request_of(fed.command);
  request.arguments = arguments_of(fed.command);
  const std::uint64_t at_us = fed.command.execute_at_robot_us;
  request.time_to_live = microseconds{at_us - std::min(at_us, robot_now_us) + kGraceUs};
  const auto sent = co_await parts_.station.submit(std::move(request));
  if (generation != generation_) co_return;
  if (sent && was_accepted(sent->state)) {
    accepted_.insert(sent->id);
    co_return;
  }
  const bool is_unheard = sent ? is_late(*sent) : sent.error().reason == "not_connected";
  if (is_unheard) co_return interrupt(came_late(protocol::kind(fed.command)));
  const std::string why = sent ? sent->reason.empty() ? text(sent->state) : sent->reason : sent.error().detail;
  const std::string whose = way_feed_ ? "the way back to 0" : fmt::format("step {}", line_.first_step + fed.step);
  abort({"command_refused", fmt::format("{}: {}: {}", whose, protocol::kind(fed.command), why)});
}

void RunDriver::renew_lease() {
  const station::RobotState& robot = *parts_.station.find(request_.robot_id);
  const std::int64_t now_us = parts_.clock.steady_us(), silent_us = life_.silent_for_us(now_us);
  // SAFETY: only by a fresh sign of life of the actor, and for no longer than that is worth.
  if (request_.is_unattended || !is_fresh() || !feed_.needs_lease(robot_now_us(robot))) return;
  if (is_renewing_ || now_us - renewed_at_us_ < kRenewsEvery.count()) return;
  renewed_at_us_ = now_us;
  is_renewing_ = true;
  const microseconds life{std::max<std::int64_t>(station::kOldestSight.count() - silent_us, 1)};
  spawn(send_renewal(life));
}

// What was not renewed lapses, and telemetry shows it.
asio::awaitable<void> RunDriver::send_renewal(microseconds time_to_live) {
  const runtime::Counted one_more{on_their_way_};
  protocol::Command renew = rheonaut_Command_init_zero;
  renew.which_action = rheonaut_Command_renew_lease_tag;
  station::CommandRequest request = request_of(renew);
  request.time_to_live = time_to_live;
  struct Renewed {
    bool& is_renewing;
    ~Renewed() { is_renewing = false; }
  };
  const Renewed renewed{is_renewing_};
  co_await parts_.station.submit(std::move(request));
}

void RunDriver::note_steps(std::uint64_t robot_now_us) {
  while (next_begin_ < line_.step_begins.size()) {
    const std::uint64_t at_us = feed_.robot_time_us(line_.step_begins[next_begin_]);
    if (at_us > robot_now_us) return;
    begins_.push_back({next_begin_++, at_us});
  }
}

// --- its state ---

// In a pause the line stands where it was broken off.
std::uint64_t RunDriver::shown_robot_us() const {
  if (paused_robot_us_ != 0) return paused_robot_us_;
  const station::RobotState* robot = parts_.station.find(request_.robot_id);
  return robot == nullptr ? 0 : robot_now_us(*robot);
}

double RunDriver::elapsed_s() const { return static_cast<double>(feed_.tick_at(shown_robot_us())) * kTick_s; }

std::size_t RunDriver::step() const { return feed_.step_at(shown_robot_us()); }

}  // namespace server::experiments
