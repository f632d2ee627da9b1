// What the station knows of its robots otherwise than by what they send: restored, asked for, named by people.
#include "server/station/station.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/station/state/audit_details.hpp"
#include "server/station/station_parts.hpp"

namespace server::station {
namespace {

// The configuration may have been changed since: a fluid that is no longer listed is not known.
void restore_fluid(RobotState& robot, const std::string& fluid, const config::Envelope& envelope) {
  robot.fluid = envelope.is_listed(fluid) ? fluid : "";
  if (robot.fluid == fluid) return;
  spdlog::warn(
      "robot '{}' is in the fluid '{}', which the configuration does not list: the strictest limits of all fluids hold "
      "for it until its fluid is named",
      robot.id, fluid);
}

}  // namespace

Station::Station(boost::asio::io_context& loop, runtime::Clock& clock, config::Envelope envelope,
                 config::LinkTimes times)
    : parts_{std::make_unique<StationParts>(loop, clock, std::move(envelope), times)} {}

Station::~Station() = default;

void Station::add_sink(StationSink& sink) { parts_->notifier.add(sink); }

void Station::restore(const std::vector<RestoredRobot>& robots, const std::vector<CommandRecord>& pending_stops,
                      const std::vector<Reservation>& reservations) {
  for (const RestoredRobot& restored : robots) {
    RobotEntry& entry = parts_->robots.add(restored.id);
    RobotState& robot = entry.robot;
    robot.boot_id = restored.boot_id;
    entry.timed.is_of_earlier_run = restored.boot_id != 0;  // SAFETY: whose they are is not known any more
    robot.context.emergency_id = restored.emergency_id;     // SAFETY: the station's latch outlives the station
    robot.retired_at_us = restored.retired_at_us;
    entry.moves_for = restored.moves_for;
    restore_fluid(robot, restored.fluid, parts_->envelope);
  }
  for (const CommandRecord& record : pending_stops) {
    parts_->stops.restore(parts_->robots.add(record.robot_id), record);
  }
  for (const Reservation& reservation : reservations) parts_->control.reservations().add(reservation);
  for (auto& [id, entry] : parts_->robots.entries()) {
    const Reservation* running = parts_->control.reservations().running(id, parts_->clock.utc_us());
    if (running != nullptr) entry.robot.reservation = *running;
  }
}

const std::map<RobotId, RobotState>& Station::robots() const { return parts_->robots.states(); }

const RobotState* Station::find(const RobotId& id) const {
  const RobotEntry* entry = parts_->robots.find(id);
  return entry == nullptr ? nullptr : &entry->robot;
}

const RobotSettings* Station::settings(const RobotId& id) const {
  const RobotEntry* entry = parts_->robots.find(id);
  return entry == nullptr ? nullptr : &entry->reported.settings();
}

const StopTimes& Station::stop_times() const { return parts_->tracker.stop_times(); }

const runtime::TimeHistogram& Station::round_trips() const { return parts_->round_trips; }
std::uint64_t Station::invalid_values() const { return parts_->invalid_values; }
std::uint64_t Station::events_left_out() const { return parts_->events_left_out; }
config::LinkTimes Station::link_times() const { return parts_->times; }
const config::Envelope& Station::envelope() const { return parts_->envelope; }

void Station::remember(const CommandRecord& ended) { parts_->tracker.recent().put(ended, kLongAgoUs); }

const CommandRecord* Station::known_command(const RobotId& robot_id, CommandId id) const {
  const RobotEntry* entry = parts_->robots.find(robot_id);
  const auto pending = entry == nullptr ? nullptr : entry->commands.on_its_way(id);
  if (pending != nullptr) return &pending->record;
  const auto* recent = parts_->tracker.recent().find(id);
  return recent == nullptr ? nullptr : &recent->record;
}

void Station::set_on_model_wanted(OnModelWanted on_model_wanted) {
  parts_->on_model_wanted = std::move(on_model_wanted);
}

// SAFETY: a fluid brings its limits. While somebody is in control nobody else changes the limits that they command
// under.
Result<void> Station::set_fluid(const RobotId& id, const std::string& text, const Author& by) {
  RobotEntry* entry = parts_->robots.find(id);
  if (entry == nullptr) {
    return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", id), "unknown_robot");
  }
  const auto listed = parts_->envelope.listed(text);
  if (!listed) return std::unexpected{listed.error()};
  const std::string& fluid = *listed;
  RobotState& robot = entry->robot;
  if (robot.fluid == fluid) {
    // SAFETY: who may not command the robot sends it no model either.
    if (parts_->control.may_use(id, by.actor)) parts_->on_model_wanted(robot, by, {});
    return {};
  }
  if (auto permitted = parts_->control.may_use(id, by.actor); !permitted) {
    permitted.error().detail += "; only who is in control changes the fluid";
    note_refusal(by, id, "fluid", refused_fluid(fluid), permitted.error());
    return permitted;
  }
  const config::Envelope& envelope = parts_->envelope;
  const bool is_narrower = is_narrower_than(envelope.in(fluid), envelope.in(robot.fluid));
  const std::string before = std::exchange(robot.fluid, fluid);
  if (is_narrower && !parts_->end_beyond_limits(*entry)) {
    robot.fluid = before;
    return fail(ErrorCode::unavailable,
                "the robot moves beyond the limits of that fluid, and its link is full: ask again", "queue_full");
  }
  parts_->notifier.publish_fluid(robot);
  parts_->notifier.publish(AuditNote{by, id, "robot.fluid_set", fluid, fluid_detail(before)});
  parts_->notifier.note(robot, "fluid_set", fmt::format("{} by {}", fluid.empty() ? "not known" : fluid, by.actor));
  parts_->notifier.publish(robot);
  parts_->on_model_wanted(robot, by, {});
  return {};
}

// SAFETY: a model changes the estimate that the robot steers by, so who may not command it sends it none; and one that
// was found in another fluid is not sent.
Result<void> Station::may_send_model(const RobotId& id, const std::string& text, const Author& by) {
  const RobotEntry* entry = parts_->robots.find(id);
  if (entry == nullptr) {
    return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", id), "unknown_robot");
  }
  if (auto permitted = parts_->control.may_use(id, by.actor); !permitted) {
    permitted.error().detail += "; only who is in control sends it a model";
    note_refusal(by, id, "model", refused_model(text), permitted.error());
    return permitted;
  }
  const auto fluid = parts_->envelope.listed(text);
  if (!fluid) return std::unexpected{fluid.error()};
  const std::string& named = entry->robot.fluid;
  if (named != *fluid) {
    return fail(
        ErrorCode::conflict,
        fmt::format("the model is of '{}', and robot '{}' is in {}; name its fluid first if it is in '{}'", *fluid, id,
                    named.empty() ? "a fluid that nobody has named" : fmt::format("'{}'", named), *fluid),
        "other_fluid");
  }
  if (entry->robot.link != LinkState::connected) {
    return fail(ErrorCode::not_connected, "the robot is not connected; send the model when it is", "not_connected");
  }
  return {};
}

Result<void> Station::send_model(const RobotId& id, const std::string& fluid, FluidModel model, const Author& by) {
  if (auto may = may_send_model(id, fluid, by); !may) return may;
  model.set_by = by.actor;
  model.set_at_us = by.at_us;
  parts_->on_model_wanted(parts_->robots.find(id)->robot, by, std::move(model));
  return {};
}

void Station::set_model(const RobotId& id, RobotModel model) {
  RobotEntry* entry = parts_->robots.find(id);
  if (entry == nullptr || entry->robot.model == model) return;
  entry->robot.model = std::move(model);
  parts_->notifier.publish(entry->robot);
}

void Station::note_model(const RobotId& id, const char* kind, const std::string& detail) {
  if (const RobotEntry* entry = parts_->robots.find(id)) parts_->notifier.note(entry->robot, kind, detail);
}

void Station::note_interruption(const RobotId& id, const BootPart& part, const std::string& reason,
                                const std::string& detail) {
  const RobotEntry* entry = parts_->robots.find(id);
  if (entry != nullptr) parts_->notifier.note_part(entry->robot, "experiment_interrupted", detail, reason, part);
}

void Station::note_pause(const RobotId& id, BootId boot_id, std::uint64_t from_robot_us, const std::string& reason,
                         const std::string& detail) {
  const RobotEntry* entry = parts_->robots.find(id);
  const BootPart begun{boot_id, from_robot_us, 0};
  if (entry != nullptr) parts_->notifier.note_part(entry->robot, "experiment_paused", detail, reason, begun);
}

void Station::set_retired(const RobotId& id, std::int64_t retired_at_us, const std::string& actor) {
  RobotEntry* entry = parts_->robots.find(id);
  if (entry == nullptr || entry->robot.retired_at_us == retired_at_us) return;
  RobotState& robot = entry->robot;
  const bool was_retired = std::exchange(robot.retired_at_us, retired_at_us) != 0;
  if (was_retired && retired_at_us == 0) parts_->notifier.note(robot, "unretired", "by " + actor);
  if (!was_retired) parts_->notifier.note(robot, "retired", "by " + actor);
  parts_->notifier.publish(robot);
}

void Station::end_connection(const RobotId& id, const std::string& reason) {
  const RobotEntry* entry = parts_->robots.find(id);
  if (entry != nullptr && entry->link != nullptr) entry->link->close(reason);
}

void Station::on_durable(const RobotId& id, BootId boot_id, std::uint64_t durable_next_seq,
                         std::uint64_t durable_next_event_seq) {
  RobotEntry* entry = parts_->robots.find(id, boot_id);
  if (entry == nullptr) return;
  entry->robot.durable_next_seq = durable_next_seq;
  entry->robot.durable_next_event_seq = durable_next_event_seq;
  if (entry->link != nullptr) entry->link->acknowledge(durable_next_seq, durable_next_event_seq);
}

void Station::request_resend(const RobotId& id, BootId boot_id, std::uint64_t first_seq, std::uint64_t next_seq) {
  const RobotEntry* entry = parts_->robots.find(id, boot_id);
  if (entry != nullptr && entry->link != nullptr) entry->link->request_resend(first_seq, next_seq);
}

void Station::request_event_resend(const RobotId& id, BootId boot_id) {
  const RobotEntry* entry = parts_->robots.find(id, boot_id);
  if (entry != nullptr && entry->link != nullptr) entry->link->request_event_resend();
}

void Station::note_returned(const RobotId& id, BootId boot_id, std::uint64_t first_seq, std::uint64_t last_seq,
                            std::uint64_t samples) {
  const RobotEntry* entry = parts_->robots.find(id, boot_id);
  if (entry == nullptr) return;
  parts_->notifier.note(entry->robot, "given_up_samples_returned",
                        fmt::format("{} samples between {} and {} of boot {}, which are not recorded", samples,
                                    first_seq, last_seq, boot_id));
}

}  // namespace server::station
