// Every message that a robot sends, built from code.
#include "golden_builders.hpp"

namespace protocol {
namespace {

void build_hello(Built& built) {
  auto frame = from_robot(rheonaut_RobotFrame_hello_tag, 120'000);
  Hello& hello = frame.body.hello;
  hello.protocol_version = kProtocolVersion;
  set_text(hello.robot_id, "swimmer-1");
  hello.boot_id = kBoot;
  hello.reset_cause = rheonaut_RESET_CAUSE_POWER_ON;
  set_text(hello.firmware_version, "0.1.0");
  hello.sample_period_us = 10'000;
  hello.ring_capacity = 800;
  hello.next_seq = 12;
  hello.next_event_seq = 1;
  hello.parameters_checksum = 0x1234'5678;
  hello.controller_id = 1;
  hello.controller_checksum = paper_controller().checksum;
  hello.mode = rheonaut_MODE_MANUAL;
  built["hello"] = framed(frame);
  hello.answers_stop_probes = true;
  built["hello_answers_stop_probes"] = framed(frame);
  hello.answers_stop_probes = false;

  frame.robot_time_us = kMax64;
  set_text(hello.robot_id, "abcdefghijklmnopqrstuvwxyz_0123");
  set_text(hello.token, "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef0123456");
  hello.boot_id = hello.oldest_seq = hello.next_seq = hello.oldest_event_seq = hello.next_event_seq = kMax64;
  hello.acknowledged_next_seq = hello.acknowledged_next_event_seq = kMax64;
  hello.reset_cause = rheonaut_RESET_CAUSE_WATCHDOG;
  set_text(hello.firmware_version, "12.34.56-rc7+build.1234");
  hello.sample_period_us = hello.ring_capacity = hello.parameters_checksum = kMax32;
  hello.controller_id = hello.controller_checksum = kMax32;
  hello.mode = rheonaut_MODE_EMERGENCY;
  hello.emergency_id = kMax64;
  hello.emergency_cause = rheonaut_EMERGENCY_CAUSE_RESET;
  built["hello_latched"] = framed(frame);
}

void build_heartbeats(Built& built) {
  auto robot = from_robot(rheonaut_RobotFrame_heartbeat_tag);
  built["heartbeat"] = framed(robot);
  robot.body.heartbeat.echo_station_time_us = 86'400'000'000;
  robot.body.heartbeat.echo_received_at_robot_us = 1'499'210;
  built["heartbeat_answer"] = framed(robot);

  auto station = from_station(rheonaut_StationFrame_heartbeat_tag);
  StationHeartbeat& heartbeat = station.body.heartbeat;
  built["station_heartbeat_empty"] = framed(station);
  heartbeat = {86'400'000'000, 140, 1, 0, 0, false};
  built["station_heartbeat"] = framed(station);
  heartbeat = {0, 140, 1, 145, 150, true};
  built["station_heartbeat_resend"] = framed(station);
  heartbeat = {kMax64, kMax64, kMax64, kMax64, kMax64, true};
  built["station_heartbeat_limits"] = framed(station);
}

void build_stop_probes(Built& built) {
  auto station = from_station(rheonaut_StationFrame_stop_probe_tag);
  station.body.stop_probe.station_time_us = 86'400'000'000;
  built["stop_probe"] = framed(station);
  station.body.stop_probe.station_time_us = kMax64;
  built["stop_probe_limits"] = framed(station);
  auto robot = from_robot(rheonaut_RobotFrame_stop_probe_answer_tag);
  robot.body.stop_probe_answer.echo_station_time_us = 86'400'000'000;
  built["stop_probe_answer"] = framed(robot);
  robot.robot_time_us = robot.body.stop_probe_answer.echo_station_time_us = kMax64;
  built["stop_probe_answer_limits"] = framed(robot);
}

void build_small_batches(Built& built) {
  auto frame = from_robot(rheonaut_RobotFrame_telemetry_tag);
  Telemetry& batch = frame.body.telemetry;
  batch.first_seq = 149;
  batch.first_robot_time_us = 1'500'000;
  batch.period_us = 10'000;
  batch.oldest_seq = 100;
  batch.mode = rheonaut_MODE_MANUAL;
  batch.position_sd_m = 0.001F;
  batch.controller_id = 1;
  set_sample_count(batch, 1);
  batch.position_m[0] = 0.0125F;
  batch.velocity_m_s[0] = 0.02F;
  batch.acceleration_m_s2[0] = -0.5F;
  batch.duty[0] = 0.3F;
  batch.impedance_mv[0] = 175;
  built["telemetry_one_sample"] = framed(frame);

  frame.robot_time_us = 9'000'000;
  batch.first_seq = batch.oldest_seq = 150;
  batch.first_robot_time_us = 1'510'000;
  batch.mode = rheonaut_MODE_EMERGENCY;
  batch.position_sd_m = 0.002F;
  batch.emergency_id = kEmergency;
  batch.flags =
      rheonaut_TELEMETRY_FLAG_BACKFILL | rheonaut_TELEMETRY_FLAG_LINK_LOSS | rheonaut_TELEMETRY_FLAG_SENSOR_FAULT;
  batch.emergency_cause = rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK;
  batch.position_m[0] = batch.reference_m[0] = 0.013F;
  batch.velocity_m_s[0] = 0.019F;
  batch.acceleration_m_s2[0] = batch.duty[0] = 0;
  built["telemetry_emergency_backfill"] = framed(frame);
}

void build_auto_batches(Built& built) {
  auto frame = from_robot(rheonaut_RobotFrame_telemetry_tag, 10'252'000);
  Telemetry& batch = frame.body.telemetry;
  batch.first_seq = 1000;
  batch.first_robot_time_us = 10'010'000;
  batch.period_us = 10'000;
  batch.oldest_seq = 700;
  batch.mode = rheonaut_MODE_AUTO;
  batch.sub_state = rheonaut_SUB_STATE_NAVIGATING;
  batch.has_setpoint_m = true;
  batch.setpoint_m = 0.1F;
  batch.disturbance_m = -0.05F;
  batch.position_sd_m = 0.0025F;
  batch.controller_id = 7;
  batch.flags = rheonaut_TELEMETRY_FLAG_SATURATED;
  set_sample_count(batch, kMaxSamplesPerFrame);
  for (std::size_t i = 0; i < kMaxSamplesPerFrame; ++i) {
    const auto k = static_cast<float>(i);
    batch.position_m[i] = k / 1024;
    batch.velocity_m_s[i] = k / 512;
    batch.acceleration_m_s2[i] = -k / 4;
    batch.duty[i] = i < 20 ? 1 : -1;
    batch.impedance_mv[i] = 175 + k / 8;
    batch.reference_m[i] = 0.1F;
  }
  batch.acceleration_m_s2[0] = 0;  // not −0
  built["telemetry_25_samples"] = framed(frame);

  frame = from_robot(rheonaut_RobotFrame_telemetry_tag, 42'949'672'972'000);
  batch.first_seq = 0x1'0000'0000;
  batch.first_robot_time_us = 42'949'672'960'000;
  batch.period_us = 10'000;
  batch.oldest_seq = batch.first_seq - 800;
  batch.mode = rheonaut_MODE_AUTO;
  batch.sub_state = rheonaut_SUB_STATE_HOLDING;
  batch.has_setpoint_m = true;
  batch.controller_id = 1;
  set_sample_count(batch, 2);
  batch.position_m[0] = -0.0005F;
  batch.acceleration_m_s2[0] = 0.01F;
  batch.acceleration_m_s2[1] = -0.01F;
  batch.duty[0] = 0.05F;
  batch.impedance_mv[0] = 174.5F;
  batch.impedance_mv[1] = 175.5F;
  built["telemetry_setpoint_zero"] = framed(frame);
}

void build_events(Built& built) {
  auto frame = from_robot(rheonaut_RobotFrame_event_tag, 120'000);
  Event& event = frame.body.event;
  event.event_robot_time_us = 10'000;
  event.kind = rheonaut_EVENT_KIND_BOOT;
  event.cause = rheonaut_EVENT_CAUSE_RESET;
  event.mode = rheonaut_MODE_MANUAL;
  built["event_boot"] = framed(frame);

  frame.robot_time_us = 1'500'000;
  event.event_seq = 1;
  event.event_robot_time_us = 1'500'000;
  event.kind = rheonaut_EVENT_KIND_MODE_CHANGED;
  event.cause = rheonaut_EVENT_CAUSE_COMMAND;
  event.sample_seq = 149;
  event.mode = rheonaut_MODE_AUTO;
  event.sub_state = rheonaut_SUB_STATE_NAVIGATING;
  event.position_m = 0.0125F;
  event.command_id = kCommand;
  built["event_mode_changed"] = framed(frame);

  frame.robot_time_us = 1'510'040;
  event.event_seq = 2;
  event.event_robot_time_us = 1'510'000;
  event.oldest_event_seq = 1;
  event.kind = rheonaut_EVENT_KIND_EMERGENCY;
  event.sample_seq = 150;
  event.mode = rheonaut_MODE_EMERGENCY;
  event.sub_state = rheonaut_SUB_STATE_NONE;
  event.position_m = 0.013F;
  event.emergency_id = kEmergency;
  event.command_id = kCommand + 6;
  event.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
  built["event_emergency"] = framed(frame);

  frame.robot_time_us = kMax64;
  event.event_seq = event.event_robot_time_us = event.oldest_event_seq = event.sample_seq = kMax64;
  event.kind = rheonaut_EVENT_KIND_TIME_STEP;
  event.cause = rheonaut_EVENT_CAUSE_TIME;
  event.mode = rheonaut_MODE_AUTO;
  event.sub_state = rheonaut_SUB_STATE_DELIVERING;
  event.position_m = std::numeric_limits<float>::lowest();
  event.value = std::numeric_limits<float>::denorm_min();
  event.emergency_id = event.command_id = kMax64;
  event.emergency_cause = rheonaut_EMERGENCY_CAUSE_INTERNAL_ERROR;
  built["event_limits"] = framed(frame);
}

void build_status_and_acks(Built& built) {
  auto frame = from_robot(rheonaut_RobotFrame_status_tag);
  frame.body.status = {7400, -61, 21'504, 2310, 3, 42, 3, 1, 12, 2};
  built["status"] = framed(frame);

  const auto acknowledge = [&](const char* name, std::uint64_t robot_time_us, CommandAck ack) {
    auto answer = from_robot(rheonaut_RobotFrame_command_ack_tag, robot_time_us);
    answer.body.command_ack = ack;
    built[name] = framed(answer);
  };
  constexpr auto kNone = rheonaut_REJECT_REASON_NONE;
  acknowledge("command_ack_accepted", 1'500'040, {kCommand, rheonaut_COMMAND_RESULT_ACCEPTED, kNone, 1'500'000, 0});
  acknowledge("command_ack_stop", 1'503'240,
              {kCommand + 6, rheonaut_COMMAND_RESULT_ACCEPTED, kNone, 1'503'200, kEmergency});
  acknowledge("command_ack_rejected", 1'600'000,
              {kCommand + 1, rheonaut_COMMAND_RESULT_REJECTED, rheonaut_REJECT_REASON_LATCHED, 0, kEmergency});
  acknowledge("command_ack_expired", 7'000'000, {kCommand + 1, rheonaut_COMMAND_RESULT_EXPIRED, kNone, 0, 0});
  acknowledge("command_ack_duplicate", 1'700'000, {kCommand, rheonaut_COMMAND_RESULT_DUPLICATE, kNone, 1'500'000, 0});
  acknowledge("command_ack_other_boot", 130'000, {kMax64, rheonaut_COMMAND_RESULT_OTHER_BOOT, kNone, 0, 0});
}

void build_parameters_and_controller(Built& built) {
  auto frame = from_robot(rheonaut_RobotFrame_parameter_page_tag);
  auto& page = frame.body.parameter_page;
  page.command_id = kCommand + 10;
  page.total = 2;
  page.parameters_count = 2;
  page.parameters[0] = {"link_timeout_ms", "ms", 1000, 200, 10'000, 1000};
  page.parameters[1] = {"impedance_nominal_mv", "mV", 180, 50, 500, 175};
  built["parameter_page"] = framed(frame);
  page.first_index = page.total = 40;
  page.parameters_count = 0;
  built["parameter_page_empty"] = framed(frame);

  frame = from_robot(rheonaut_RobotFrame_controller_tag);
  frame.body.controller = paper_controller();
  built["controller"] = framed(frame);
}

}  // namespace

void build_robot_frames(Built& built) {
  build_hello(built);
  build_heartbeats(built);
  build_stop_probes(built);
  build_small_batches(built);
  build_auto_batches(built);
  build_events(built);
  build_status_and_acks(built);
  build_parameters_and_controller(built);
}

}  // namespace protocol
