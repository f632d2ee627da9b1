// What people and scripts ask for: commands, emergency stops, control, reservations.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <set>
#include <utility>

#include "server/runtime/exceptions.hpp"
#include "server/station/command_dispatch.hpp"
#include "server/station/commands/command_checks.hpp"
#include "server/station/state/audit_details.hpp"
#include "server/station/station.hpp"
#include "server/station/station_parts.hpp"

namespace server::station {
namespace asio = boost::asio;

namespace {

constexpr microseconds kSeenPatience{6'000'000};  // for a command's end, after its answer
constexpr microseconds kWatchInterval{200'000};

Error unknown_robot(const RobotId& id) {
  return {ErrorCode::not_found, fmt::format("no robot '{}' is known", id), "unknown_robot"};
}

// The stops were handed to their links; now they are recorded. One that fails keeps no other from it.
void publish_stops(SinkNotifier& notifier, const RobotTable& robots, const std::vector<CommandRecord>& records,
                   std::vector<RobotId>& failed) {
  std::set<RobotId> published;
  for (const CommandRecord& record : records) {
    try {
      notifier.publish(record);
      if (published.insert(record.robot_id).second) notifier.publish(robots.states().at(record.robot_id));
    } catch (const std::exception& error) {
      spdlog::error("emergency stop of robot '{}': {}", record.robot_id, runtime::text_of(error));
      if (std::ranges::find(failed, record.robot_id) == failed.end()) failed.push_back(record.robot_id);
    }
  }
}

// A stop that is answered by one in force makes no new command; who asked for it is recorded all the same.
// SAFETY: each press holds what waits for the robot, also the press of somebody whose stop is under way already.
void publish_stop_again(StationParts& parts, const StopRequest& request, const CommandRecord& in_force) {
  const CommandId asked = command_id_of(in_force.robot_id, request.actor, request.key);
  if (!request.key.empty() && asked == in_force.id) return;  // the same press, by another way
  parts.notifier.publish_stop_again(in_force);
  AuditNote note;
  note.by = {request.actor, request.peer, parts.clock.utc_us()};
  note.robot_id = in_force.robot_id;
  note.action = "command.stop_again";
  note.subject = std::to_string(in_force.id);
  note.can_flood = true;
  parts.notifier.publish(note);
}

// The robot's answer or, right after the command's time to live, that there was none; with `until_verified` its end.
asio::awaitable<Result<CommandRecord>> outcome_of(StationParts& parts, std::shared_ptr<PendingCommand> pending,
                                                  bool until_verified) {
  const microseconds patience{pending->answer_due_us - parts.clock.steady_us()};
  co_await parts.tracker.follow(pending, false, patience);
  // Frames of the robot end what is overdue; of one that is silent this does.
  if (RobotEntry* entry = parts.robots.find(pending->record.robot_id)) parts.tracker.expire(*entry);
  if (until_verified) co_await parts.tracker.follow(pending, true, kSeenPatience);
  co_return pending->record;
}

// When it goes, what waits to be recorded is recorded, and how much was left out.
class RecordsAtTheEnd {
 public:
  explicit RecordsAtTheEnd(StationParts& parts) : parts_{parts} {}
  ~RecordsAtTheEnd() {
    try {
      parts_.record_waiting(true);
    } catch (const std::exception& error) {
      spdlog::error("what was left out of the record was not counted in it: {}", runtime::text_of(error));
    }
  }
  RecordsAtTheEnd(const RecordsAtTheEnd&) = delete;
  RecordsAtTheEnd& operator=(const RecordsAtTheEnd&) = delete;

 private:
  StationParts& parts_;
};

std::string slot_text(const Reservation& slot) {
  const std::string purpose = slot.purpose.empty() ? "" : ": " + slot.purpose;
  return fmt::format("{} for {} from {} until {}{}", slot.id, slot.holder, utc_text(slot.from_us),
                     utc_text(slot.until_us), purpose);
}

}  // namespace

asio::awaitable<Result<CommandRecord>> Station::submit(CommandRequest request) {
  RobotEntry* const known = parts_->robots.find(request.robot_id);
  if (known == nullptr) co_return parts_->refuse(request, unknown_robot(request.robot_id));
  if (request.action.which_action == rheonaut_Command_emergency_stop_tag) {
    StopRequest stop{request.robot_id, request.actor, request.peer, request.key, request.received_us};
    co_return co_await emergency_stop(std::move(stop), request.time_to_live);
  }
  // SAFETY: what moves, and waited while the station stood still, is as old as that.
  if (moves_the_motor(request.action)) request.age = std::max(request.age, request.unread);
  RobotEntry& entry = *known;
  CommandTracker& tracker = parts_->tracker;
  if (!request.key.empty()) {
    const auto same = tracker.find_same(request, entry);
    if (!same) co_return parts_->refuse(request, same.error());
    if (*same != nullptr) co_return co_await outcome_of(*parts_, *same, request.until_verified);
  }
  const auto sent = dispatch(*parts_, entry, request);
  if (!sent) co_return parts_->refuse(request, sent.error());
  co_return co_await outcome_of(*parts_, *sent, request.until_verified);
}

asio::awaitable<Result<CommandRecord>> Station::emergency_stop(StopRequest request, microseconds patience) {
  RobotEntry* entry = parts_->robots.find(request.robot_id);
  if (entry == nullptr) {
    Error error = unknown_robot(request.robot_id);
    note_refusal({request.actor, request.peer, parts_->clock.utc_us()}, request.robot_id, "command", refused_stop(),
                 error);
    co_return std::unexpected{std::move(error)};
  }
  std::shared_ptr<PendingCommand> stop;
  bool is_again = false;
  const auto begin = [&](std::vector<CommandRecord>& made) {
    is_again = parts_->stops.stop_in_force(*entry, request) != nullptr;
    stop = parts_->stops.begin(*entry, request, made);
  };
  parts_->publish_stops_of(begin, &entry->robot);
  if (is_again) publish_stop_again(*parts_, request, stop->record);
  const bool is_connected = entry->link != nullptr;
  auto outcome = co_await parts_->tracker.follow(stop, false, patience);
  // The log can wait: it is written once the answer has gone.
  asio::post(parts_->loop, [request = std::move(request), record = *outcome, is_connected] {
    const char* state = is_connected ? text(record.state) : "kept until it returns";
    spdlog::warn("emergency stop of robot '{}' by {}: {}", request.robot_id, request.actor, state);
  });
  co_return outcome;
}

asio::awaitable<StopsOfAll> Station::stop_all(StopRequest request, microseconds patience) {
  const std::int64_t deadline_us = parts_->clock.steady_us() + patience.count();
  std::vector<std::pair<std::shared_ptr<PendingCommand>, bool>> stops;  // and whether the robot is there
  std::vector<CommandRecord> records;  // published once every frame has been handed over
  std::vector<CommandRecord> again;    // those in force already, published then, too
  StopsOfAll outcome;
  for (auto& [id, entry] : parts_->robots.entries()) {
    if (parts_->stops.may_be_left_out(entry)) {
      outcome.left_out.push_back(id);
      continue;
    }
    try {
      if (const auto same = parts_->stops.stop_in_force(entry, request)) again.push_back(same->record);
      stops.emplace_back(parts_->stops.begin(entry, request, records), entry.link != nullptr);
    } catch (const std::exception& error) {  // SAFETY: the others are stopped all the same
      spdlog::error("emergency stop of robot '{}': {}", id, runtime::text_of(error));
      outcome.failed.push_back(id);
    }
  }
  publish_stops(parts_->notifier, parts_->robots, records, outcome.failed);
  for (const CommandRecord& record : again) {
    try {
      publish_stop_again(*parts_, request, record);
    } catch (const std::exception& error) {
      spdlog::error("emergency stop of robot '{}' again: {}", record.robot_id, runtime::text_of(error));
    }
  }
  spdlog::warn("emergency stop of all {} robots by {}; {} retired ones are not connected and left out", stops.size(),
               request.actor, outcome.left_out.size());
  for (const auto& [stop, is_connected] : stops) {
    const microseconds left{is_connected ? std::max<std::int64_t>(deadline_us - parts_->clock.steady_us(), 0) : 0};
    if (left.count() > 0) co_await parts_->tracker.follow(stop, false, left);
    const bool has_failed = std::ranges::find(outcome.failed, stop->record.robot_id) != outcome.failed.end();
    if (!has_failed) outcome.records.push_back(stop->record);
  }
  co_return outcome;
}

Result<ControlState> Station::control(const ControlRequest& request) {
  RobotEntry* entry = parts_->robots.find(request.robot_id);
  if (entry != nullptr) parts_->drop_outdated(*entry);
  Result<std::optional<Authority::Change>> change = std::unexpected{unknown_robot(request.robot_id)};
  if (entry != nullptr) change = parts_->control.change(request);
  if (!change) {
    note_refusal({request.actor, request.peer, parts_->clock.utc_us()}, request.robot_id, "control",
                 refused_control(text(request.action)), change.error());
    return std::unexpected{change.error()};
  }
  const Client now = parts_->control.client_of(request.robot_id);
  const bool keeps_orders = request.orders_of && entry->timed.by == Client{request.actor, *request.orders_of};
  if (keeps_orders) entry->timed.by = now;
  if (*change) parts_->publish(**change, request.actor, request.peer);
  parts_->drop_outdated(*entry);
  return parts_->control.of(request.robot_id);
}

void Station::keep_control(const Client& client, const std::optional<RobotId>& robot, microseconds age) {
  parts_->control.keep(client, robot, age);
}

std::string Station::holder(const RobotId& id) const { return parts_->control.of(id).holder; }

bool Station::is_kept_by(const RobotId& id, const Client& client) const {
  return parts_->control.is_kept_by(id, client);
}

void Station::end_right(const runtime::EndedRight& right) {
  parts_->notifier.publish_right_ended(right);
  for (auto& [id, entry] : parts_->robots.entries()) {
    try {
      parts_->end_right(entry, right);
    } catch (const std::exception& error) {  // SAFETY: the others come to rest all the same
      spdlog::error("what robot '{}' does in a name whose right has ended: {}", id, runtime::text_of(error));
    }
  }
}

std::set<std::string> Station::acting() const {
  std::set<std::string> actors;
  for (const auto& [id, entry] : parts_->robots.entries()) parts_->add_acting(entry, actors);
  return actors;
}

asio::awaitable<void> Station::watch_control() {
  const RecordsAtTheEnd records_at_the_end{*parts_};
  for (;;) {
    co_await parts_->clock.sleep_for(kWatchInterval);
    parts_->end_control();
    parts_->show_reservations();
    parts_->record_waiting(false);
  }
}

Result<void> Station::check_reservation(const Reservation& wanted, bool is_by_admin) const {
  const std::int64_t utc_us = parts_->clock.utc_us();
  if (auto checked = parts_->control.reservations().check(wanted, utc_us); !checked) return checked;
  const std::string in_control = holder(wanted.robot_id);
  const bool is_on_notice = wanted.from_us >= utc_us + kReservationNotice.count();
  if (is_by_admin || is_on_notice || in_control.empty() || account_of(in_control) == wanted.holder) return {};
  // SAFETY: control changes hands behind nobody's back, and only an administrator takes it away.
  return fail(ErrorCode::conflict,
              fmt::format("robot '{}' is controlled by {}; a reservation that keeps them out begins {} min from now at "
                          "the earliest",
                          wanted.robot_id, in_control, kReservationNotice / std::chrono::minutes{1}),
              "not_in_control");
}

void Station::add_reservation(const Reservation& made) {
  parts_->control.reservations().add(made);
  const RobotEntry* entry = parts_->robots.find(made.robot_id);
  if (entry != nullptr)
    parts_->notifier.note(entry->robot, "reservation_made", slot_text(made) + ", by " + made.made_by);
  parts_->end_control();
  parts_->show_reservations();
}

void Station::remove_reservation(ReservationId id, const std::string& cancelled_by) {
  // SAFETY: what it has ended stays ended.
  parts_->end_control();
  const Reservation* found = find_reservation(id);
  if (found == nullptr) return;
  const RobotEntry* entry = parts_->robots.find(found->robot_id);
  if (entry != nullptr) {
    parts_->notifier.note(entry->robot, "reservation_cancelled", slot_text(*found) + ", by " + cancelled_by);
  }
  parts_->control.reservations().remove(id);
  parts_->show_reservations();
}

const Reservation* Station::find_reservation(ReservationId id) const { return parts_->control.reservations().find(id); }

const Reservation* Station::reserved_for_another(const RobotId& id, const std::string& actor,
                                                 microseconds ahead) const {
  return parts_->control.keeps_out(id, actor, ahead);
}

std::string Station::account_of(const std::string& actor) const {
  return parts_->control.reservations().account_of(actor);
}

void Station::set_account_of(Reservations::AccountOf account_of) {
  parts_->control.reservations().set_account_of(std::move(account_of));
}

void Station::note_refusal(Author by, const RobotId& robot_id, const char* what, std::string detail,
                           const Error& error) {
  parts_->publish_refusal(std::move(by), robot_id, what, detail, error);
}

}  // namespace server::station
