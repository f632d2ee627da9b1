// Writes robots, samples, commands and events as JSON.
#include "server/live/state_json.hpp"

#include <charconv>
#include <cmath>

#include "server/station/state/unknown_values.hpp"

namespace server::live {
namespace {

using nlohmann::json;

json status_json(const protocol::Status& status) {
  return {{"supply_mv", decimal(status.supply_mv)},        {"rssi_dbm", status.rssi_dbm},
          {"free_memory_bytes", status.free_memory_bytes}, {"worst_tick_us", status.worst_tick_us},
          {"missed_ticks", status.missed_ticks},           {"ring_fill", status.ring_fill},
          {"imu_calibration", status.imu_calibration},     {"bad_frames", status.bad_frames},
          {"lost_samples", status.lost_samples},           {"lost_events", status.lost_events}};
}

json clock_json(const station::RobotState& robot) {
  const station::ClockEstimate& clock = robot.clock;
  return {{"offset_us", clock.offset_us},
          {"uncertainty_us", clock.uncertainty_us(robot.latest_robot_time_us)},
          {"drift_ppm", clock.drift_ppm},
          {"round_trip_us", clock.round_trip_us}};
}

json field_json(const std::optional<float>& value) { return value ? decimal(*value) : json(nullptr); }
json field_json(std::uint64_t id) { return id_text(id); }
template <class Value>
json field_json(const Value& value) {
  return station::text_or_value(value);
}

json object_or_null(const std::optional<std::string>& text) { return text ? json::parse(*text) : json(nullptr); }

void append(std::string& out, float value) {
  if (!std::isfinite(value)) {
    out += "null";
    return;
  }
  char digits[32];
  const auto [end, error] = std::to_chars(digits, digits + sizeof digits, value);
  out.append(digits, end);
}

void append_column(std::string& out, const char* name, const std::vector<station::Sample>& samples,
                   float station::Sample::* channel) {
  out += ",\"";
  out += name;
  out += "\":[";
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (i > 0) out += ',';
    append(out, samples[i].*channel);
  }
  out += ']';
}

}  // namespace

json id_text(std::uint64_t id) { return id == 0 ? json(nullptr) : json(std::to_string(id)); }

json time_or_null(std::int64_t time_us) { return time_us == 0 ? json(nullptr) : json(time_us); }

json to_json(const station::Sample& sample) {
  json out;
  station::for_each_sample_field(
      [&](const station::SampleField& field) { out[field.name] = decimal(sample.*field.member); });
  return out;
}

json to_json(const station::ControlState& control) {
  return {{"holder", control.holder},
          {"taken_at_us", control.taken_at_us},
          {"wished_by", control.requested_by.empty() ? json(nullptr) : json(control.requested_by)}};
}

json to_json(const station::Reservation& reservation) {
  return {{"reservation_id", reservation.id},
          {"robot_id", reservation.robot_id},
          {"holder", reservation.holder},
          {"from_us", reservation.from_us},
          {"until_us", reservation.until_us},
          {"purpose", reservation.purpose},
          {"made_by", reservation.made_by},
          {"made_at_us", reservation.made_at_us},
          {"cancelled_at_us", time_or_null(reservation.cancelled_at_us)},
          {"cancelled_by", reservation.cancelled_by.empty() ? json(nullptr) : json(reservation.cancelled_by)}};
}

json to_json(const station::ChangedLimit& limit) {
  return {{"name", limit.name},
          {"unit", limit.unit},
          {"value", decimal(limit.value)},
          {"default", decimal(limit.default_value)}};
}

json to_json(const station::RobotModel& model) {
  return {{"state", text(model.state)},
          {"fluid", model.fluid.empty() ? json(nullptr) : json(model.fluid)},
          {"reason", model.reason},
          {"fit_error", model.fit_error ? json(*model.fit_error) : json(nullptr)},
          {"set_at_us", time_or_null(model.set_at_us)}};
}

json to_json(const station::StopPath& path) {
  const bool is_answered = path.answered_at_us != 0;
  return {{"is_open", path.is_open},
          {"round_trip_us", is_answered ? json(path.round_trip_us) : json(nullptr)},
          {"answered_at_us", time_or_null(path.answered_at_us)}};
}

json to_json(const station::RobotState& robot) {
  const station::SampleContext& context = robot.context;
  json out;
  out["robot_id"] = robot.id;
  out["link"] = text(robot.link);
  out["peer"] = robot.link == station::LinkState::connected ? json(robot.peer) : json(nullptr);
  out["connected_at_us"] = time_or_null(robot.connected_at_us);
  out["last_received_at_us"] = time_or_null(robot.last_received_at_us);
  out["boot_id"] = id_text(robot.boot_id);
  out["reset_cause"] = protocol::text(robot.reset_cause);
  out["firmware_version"] = robot.firmware_version;
  out["sample_period_us"] = robot.sample_period_us;
  out["ring_capacity"] = robot.ring_capacity;
  out["parameters_checksum"] = robot.parameters_checksum;
  out["controller_checksum"] = robot.controller_checksum;
  station::for_each_batch_field([&](const auto& field) { out[field.name] = field_json(context.*field.member); });
  out["sample"] = robot.sample ? to_json(*robot.sample) : json(nullptr);
  out["next_seq"] = robot.next_seq;
  out["oldest_seq"] = robot.oldest_seq;
  out["durable_next_seq"] = robot.durable_next_seq;
  out["latest_robot_time_us"] = robot.latest_robot_time_us;
  out["status"] = robot.status ? status_json(*robot.status) : json(nullptr);
  out["clock"] = robot.clock.valid ? clock_json(robot) : json(nullptr);
  out["stop_path"] = robot.stop_path.is_measured ? to_json(robot.stop_path) : json(nullptr);
  out["pending_stop"] = id_text(robot.pending_stop.value_or(0));
  out["retired"] = robot.retired_at_us != 0;
  out["fluid"] = robot.fluid.empty() ? json(nullptr) : json(robot.fluid);
  out["changed_limits"] = json::array();
  for (const station::ChangedLimit& limit : robot.changed_limits) out["changed_limits"].push_back(to_json(limit));
  out["model"] = to_json(robot.model);
  out["lease_renewed_at_us"] = time_or_null(robot.lease_renewed_at_us);
  out["invalid_values"] = robot.invalid_values;
  out["events_left_out"] = robot.events_left_out;
  out["unknown_values"] =
      object_or_null(station::UnknownValues{}.add("reset_cause", robot.reset_cause).add_fields_of(context).text());
  out["control"] = robot.control.holder.empty() ? json(nullptr) : to_json(robot.control);
  out["reservation"] = robot.reservation ? to_json(*robot.reservation) : json(nullptr);
  return out;
}

json to_json(const station::CommandRecord& record) {
  json arguments = record.arguments.empty() ? json::object() : json::parse(record.arguments, nullptr, false);
  json out;
  out["command_id"] = std::to_string(record.id);
  out["robot_id"] = record.robot_id;
  out["boot_id"] = id_text(record.boot_id);
  out["kind"] = record.kind;
  out["arguments"] = arguments.is_object() ? std::move(arguments) : json::object();
  out["actor"] = record.actor;
  out["state"] = text(record.state);
  out["reason"] = record.reason;
  out["submitted_at_us"] = record.submitted_at_us;
  out["sent_at_us"] = time_or_null(record.sent_at_us);
  out["ended_at_us"] = time_or_null(record.ended_at_us);
  out["effect_at_robot_us"] = time_or_null(static_cast<std::int64_t>(record.effect_at_robot_us));
  out["emergency_id"] = id_text(record.emergency_id);
  const auto stage = [](std::int64_t after_us) { return after_us < 0 ? json(nullptr) : json(after_us); };
  out["sent_after_us"] = stage(record.sent_after_us);
  out["acknowledged_after_us"] = stage(record.acknowledged_after_us);
  out["verified_after_us"] = stage(record.verified_after_us);
  out["life_from"] = record.life_from.empty() ? json(nullptr) : json(record.life_from);
  if (record.kind == "renew_lease") {
    out["further_renewals"] = record.further_renewals ? json(*record.further_renewals) : json(nullptr);
    out["last_renewed_at_us"] = time_or_null(record.last_renewed_at_us);
  }
  return out;
}

json to_json(const station::RobotEvent& event) {
  const bool of_robot = event.event_seq.has_value();
  const bool mode_known = event.mode != rheonaut_MODE_UNSPECIFIED;
  json out;
  out["robot_id"] = event.robot_id;
  out["boot_id"] = id_text(event.boot_id);
  out["event_seq"] = of_robot ? json(*event.event_seq) : json(nullptr);
  out["robot_time_us"] = of_robot || event.robot_time_us > 0 ? json(event.robot_time_us) : json(nullptr);
  out["sample_seq"] = of_robot ? json(event.sample_seq) : json(nullptr);
  out["kind"] = event.kind;
  out["cause"] = event.cause;
  out["emergency_cause"] = event.emergency_cause ? json(protocol::text(*event.emergency_cause)) : json(nullptr);
  out["detail"] = event.detail;
  out["unknown_values"] = object_or_null(event.unknown_values);
  out["mode"] = mode_known ? json(protocol::text(event.mode)) : json(nullptr);
  out["sub_state"] = mode_known ? json(protocol::text(event.sub_state)) : json(nullptr);
  out["position_m"] = of_robot ? decimal(event.position_m) : json(nullptr);
  out["value"] = of_robot ? decimal(event.value) : json(nullptr);
  out["emergency_id"] = id_text(event.emergency_id);
  out["command_id"] = id_text(event.command_id);
  out["received_at_us"] = event.received_at_us;
  return out;
}

std::string samples_message(const station::SampleBatch& batch) {
  const station::SampleContext& context = batch.context;
  json head;
  head["type"] = "samples";
  head["robot_id"] = batch.robot_id;
  head["boot_id"] = std::to_string(batch.boot_id);
  head["first_seq"] = batch.first_seq;
  head["first_robot_time_us"] = batch.first_robot_time_us;
  head["period_us"] = context.period_us;
  station::for_each_batch_field([&](const auto& field) {
    if (field.is_in_live_samples) head[field.name] = field_json(context.*field.member);
  });
  head["unknown_values"] = object_or_null(unknown_values(context));
  head["backfill"] = (context.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) != 0;
  std::string out = dump(head);
  out.pop_back();  // the closing brace: the columns follow
  station::for_each_sample_field(
      [&](const station::SampleField& field) { append_column(out, field.name, batch.samples, field.member); });
  out += '}';
  return out;
}

}  // namespace server::live
