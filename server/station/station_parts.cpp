#include "server/station/station_parts.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <string_view>

#include "server/station/commands/command_checks.hpp"
#include "server/station/state/audit_details.hpp"

namespace server::station {

void StationParts::publish(const Authority::Change& change, const std::string& actor, const std::string& peer) {
  RobotEntry* entry = robots.find(change.robot_id);
  if (entry == nullptr) return;
  RobotState& robot = entry->robot;
  robot.control = control.of(robot.id);
  if (!robot.control.holder.empty()) entry->moves_for = robot.control.holder;
  drop_outdated(*entry);
  notifier.note(robot, change.kind, change.cause);
  AuditNote audit;
  audit.by = {actor, peer, clock.utc_us()};
  audit.robot_id = robot.id;
  audit.action = "control." + change.kind.substr(std::string_view{"control_"}.size());
  audit.detail = control_detail(change.cause, robot.control.holder);
  notifier.publish(audit);
  notifier.publish(robot);
}

namespace {

// As far as is known: nothing moves it now, and nothing that was sent or waits may. One that is away may move.
bool is_surely_at_rest(const RobotEntry& entry) {
  const RobotState& robot = entry.robot;
  const bool rests =
      entry.link != nullptr && robot.context.mode == rheonaut_MODE_MANUAL && robot.sample && robot.sample->duty == 0;
  return rests && entry.orders_ahead().empty() && entry.commands.unanswered.empty() && entry.timed.by.actor.empty() &&
         !entry.timed.is_of_earlier_run;
}

}  // namespace

// SAFETY: what may move in that name comes to rest. A robot that surely rests is left alone.
void StationParts::end_right(RobotEntry& entry, const runtime::EndedRight& right) {
  const bool is_at_rest = is_surely_at_rest(entry);  // before what waits is dropped
  timed.withdraw_queued(entry, "control_ended",
                        [&right](const PendingCommand& pending) { return right.is_of(pending.record.actor); });
  const ControlState before = entry.robot.control;
  const auto change = control.end_right(entry.robot.id, right);
  if (change) publish(*change, "station", "");
  entry.robot.control = control.of(entry.robot.id);
  if (!change && entry.robot.control != before) notifier.publish(entry.robot);  // a request for it
  if (entry.moves_for.empty() || !right.is_of(entry.moves_for)) return;
  if (!is_at_rest && !entry.robot.latched()) notifier.publish_rest_owed(entry.robot, right);
  entry.moves_for.clear();
}

// SAFETY: limits that have become narrower end what they would refuse: an unsent command is taken back; a motion, and
// an order on its way that telemetry does not show yet, ends by an order to rest behind it; what waits for its time is
// dropped. False: the order to rest cannot be sent.
bool StationParts::end_beyond_limits(RobotEntry& entry) {
  const RobotState& robot = entry.robot;
  const auto is_refused = [&](const protocol::Command& command) {
    OrdersAhead others = entry.orders_ahead();
    std::erase_if(others, [&command](const OrderAhead& order) { return order.command == &command; });
    return !check_command(command, robot, envelope, others);
  };
  timed.withdraw_queued(entry, "limits_changed",
                        [&](const PendingCommand& pending) { return is_refused(pending.wire); });
  const OrdersAhead ahead = entry.orders_ahead();
  const bool is_order_refused = std::ranges::any_of(ahead, [&](const OrderAhead& order) {  // schedules: check_motion()
    const bool is_now = !order.command->has_execute_at_robot_us && !is_schedule(*order.command);
    return is_now && is_refused(*order.command);
  });
  const bool is_beyond = is_order_refused || !check_motion(robot, envelope.in(robot.fluid), ahead);
  if (is_beyond && !timed.bring_to_rest(entry)) return false;
  const bool is_timed_refused = std::ranges::any_of(ahead, [&](const OrderAhead& order) {
    return order.command->has_execute_at_robot_us && is_refused(*order.command);
  });
  if (is_timed_refused || entry.timed.is_of_earlier_run) {
    timed.drop_all(entry, control.client_of(robot.id), "limits_changed");
  }
  return true;
}

void StationParts::add_acting(const RobotEntry& entry, std::set<std::string>& actors) const {
  const ControlState now = control.of(entry.robot.id);
  for (const std::string& actor : {now.holder, now.requested_by, entry.moves_for, entry.timed.by.actor}) {
    if (!actor.empty()) actors.insert(actor);
  }
}

void StationParts::end_control() {
  for (const Authority::Change& change : control.expire()) publish(change, "station", "");
}

void StationParts::show_reservations() {
  const std::int64_t utc_us = clock.utc_us();
  // A day later, so that a clock that was ahead for a moment ends none: all that judges by them looks at the time.
  control.reservations().forget_over(utc_us - std::chrono::microseconds{std::chrono::days{1}}.count());
  for (auto& [id, entry] : robots.entries()) {
    const Reservation* running = control.reservations().running(id, utc_us);
    const Reservation* shown = entry.robot.reservation ? &*entry.robot.reservation : nullptr;
    const bool is_same = running == nullptr || shown == nullptr ? running == shown : *running == *shown;
    if (is_same) continue;
    entry.robot.reservation = running == nullptr ? std::nullopt : std::optional{*running};
    notifier.publish(entry.robot);
  }
}

void StationParts::publish_stops_of(const std::function<void(std::vector<CommandRecord>&)>& act,
                                    const RobotState* robot) {
  std::exception_ptr first_failure;
  const auto keep_on = [&first_failure](auto&& step) {
    try {
      step();
    } catch (...) {
      if (!first_failure) first_failure = std::current_exception();
    }
  };
  std::vector<CommandRecord> made;
  keep_on([&] { act(made); });
  for (const CommandRecord& record : made) {
    keep_on([&] { notifier.publish(record); });
  }
  if (robot != nullptr && !made.empty()) {
    keep_on([&] { notifier.publish(*robot); });
  }
  if (first_failure) std::rethrow_exception(first_failure);
}

void StationParts::publish_refusal(Author by, const RobotId& robot_id, const char* what, const std::string& detail,
                                   const Error& error) {
  constexpr std::size_t kMaxNameBytes = 40;
  AuditNote note;
  note.by = std::move(by);
  note.robot_id = robots.find(robot_id) != nullptr ? robot_id : "";
  note.action = std::string{what} + ".refused";
  note.subject = robot_id.substr(0, kMaxNameBytes);
  note.detail = refusal_detail(detail, error.detail, error.reason);
  note.can_flood = true;
  notifier.publish(note);
}

void StationParts::hold(RobotEntry& entry, protocol::EventKind kind, RobotEvent event) {
  const auto earlier = std::ranges::find_if(entry.held_events,
                                            [&event](const HeldEvent& held) { return held.event.kind == event.kind; });
  if (earlier != entry.held_events.end()) {
    const std::uint64_t event_seq = *earlier->event.event_seq;
    entry.held_events.erase(earlier);
    leave_out(entry, event_seq);
  }
  entry.held_events.push_back({kind, std::move(event)});
}

void StationParts::record_held(RobotEntry& entry, bool all) {
  std::vector<HeldEvent>& held = entry.held_events;
  for (std::size_t index = 0; index < held.size();) {
    if (!all && !entry.events.take(held[index].kind, clock.steady_us())) {
      ++index;
      continue;
    }
    const RobotEvent event = std::move(held[index].event);
    held.erase(held.begin() + static_cast<std::ptrdiff_t>(index));
    notifier.publish(entry.robot, event);
  }
}

void StationParts::record_connection(RobotEntry& entry, bool at_once) {
  const bool is_waiting = entry.link != nullptr && !entry.is_connection_recorded;
  if (!is_waiting || (!at_once && !entry.connections.take(clock.steady_us()))) return;
  entry.is_connection_recorded = true;
  const RobotState& robot = entry.robot;
  spdlog::info("robot '{}' connected from {}: boot {}, {} samples held, durable to {}", robot.id, robot.peer,
               robot.boot_id, robot.next_seq - robot.oldest_seq, robot.durable_next_seq);
  notifier.note(robot, "connected", fmt::format("from {}", robot.peer));
}

bool StationParts::end_of_recorded(RobotEntry& entry) {
  if (std::exchange(entry.is_connection_recorded, false)) return true;
  entry.connections_left_out.add(clock.steady_us());
  return false;
}

void StationParts::record_waiting(bool is_end) {
  for (auto& [id, entry] : robots.entries()) {
    record_held(entry, is_end);
    record_connection(entry, is_end);
    report_left_out(entry, is_end);
  }
}

void StationParts::leave_out(RobotEntry& entry, std::uint64_t event_seq) {
  ++events_left_out;
  ++entry.robot.events_left_out;
  entry.events_left_out.add(clock.steady_us());
  notifier.publish_event_left_out(entry.robot, event_seq);
}

void StationParts::report_left_out(RobotEntry& entry, bool at_once) {
  const std::int64_t now_us = clock.steady_us();
  if (const auto events = entry.events_left_out.report(now_us, at_once)) {
    std::string detail = fmt::format("{}: more than {} at once and {} a second are counted and not recorded",
                                     left_out_text(*events), EventAllowance::kBurst, EventAllowance::kASecond);
    spdlog::warn("robot '{}' sends too many events: {}", entry.robot.id, detail);
    notifier.note(entry.robot, "events_left_out", std::move(detail), "too_many");
  }
  if (const auto connections = entry.connections_left_out.report(now_us, at_once)) {
    std::string detail =
        fmt::format("{}: more than {} at once and {} a minute are counted and not recorded",
                    left_out_text(*connections), ConnectionAllowance::kBurst, ConnectionAllowance::kAMinute);
    spdlog::warn("robot '{}' connects too often: {}", entry.robot.id, detail);
    notifier.note(entry.robot, "connections_left_out", std::move(detail), "too_many");
  }
}

std::string StationParts::left_out_text(const LeftOutCount::Report& left_out) const {
  const std::int64_t utc_minus_steady_us = clock.utc_us() - clock.steady_us();
  return fmt::format("{} from {} to {}", left_out.count, utc_text(left_out.first_us + utc_minus_steady_us),
                     utc_text(left_out.last_us + utc_minus_steady_us));
}

// Nothing is sent, and the audit gets an entry.
std::unexpected<Error> StationParts::refuse(const CommandRequest& request, Error error) {
  const char* kind = protocol::kind(request.action);
  publish_refusal({request.actor, request.peer, clock.utc_us()}, request.robot_id, "command",
                  refused_command(kind, request.arguments), error);
  return std::unexpected{std::move(error)};
}

}  // namespace server::station
