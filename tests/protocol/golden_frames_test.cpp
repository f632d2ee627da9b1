// Every message of the protocol, built from code, has exactly the bytes of tests/data/golden_frames.txt.
// LONG: one builder per message; the file grows with the protocol and is read one builder at a time.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <map>
#include <span>

#include "golden_file.hpp"
#include "protocol/frame.hpp"

namespace protocol {
namespace {

using ByteVector = std::vector<std::uint8_t>;
using Built = std::map<std::string, ByteVector>;

constexpr std::uint64_t kMax64 = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint32_t kMax32 = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t kBoot = 0x1234'5678'9ABC'DEF0;
constexpr std::uint64_t kCommand = 0x7F00'0000'0000'0001;
constexpr std::uint64_t kEmergency = 0x5A5A'5A5A'5A5A'5A5A;

template <class Frame>
ByteVector framed(const Frame& frame) {
  ByteVector bytes(kMaxFramedBytes);
  bytes.resize(write_frame(frame, bytes.data(), bytes.size()));
  return bytes;
}

// Zero in every byte, also in the members of the union that are not chosen.
template <class Frame>
Frame zero_frame(pb_size_t which_body) {
  Frame frame;
  std::memset(&frame, 0, sizeof frame);
  frame.which_body = which_body;
  return frame;
}

RobotFrame from_robot(pb_size_t which_body, std::uint64_t robot_time_us = 1'500'000) {
  auto frame = zero_frame<RobotFrame>(which_body);
  frame.robot_time_us = robot_time_us;
  return frame;
}

StationFrame from_station(pb_size_t which_body) { return zero_frame<StationFrame>(which_body); }

// The command that most examples use: for kBoot, good until robot time 5.5 s. `number` makes its id.
StationFrame command(pb_size_t which_action, std::uint64_t number) {
  auto frame = from_station(rheonaut_StationFrame_command_tag);
  frame.body.command.command_id = kCommand - 1 + number;
  frame.body.command.boot_id = kBoot;
  frame.body.command.valid_until_robot_us = 5'500'000;
  frame.body.command.which_action = which_action;
  return frame;
}

template <std::size_t size>
void set_text(char (&field)[size], const std::string& text) {
  ASSERT_LT(text.size(), size);
  std::memcpy(field, text.c_str(), text.size() + 1);
}

template <std::size_t size>
void set_column(float (&field)[size], pb_size_t& count, std::initializer_list<float> values) {
  ASSERT_LE(values.size(), size);
  std::copy(values.begin(), values.end(), field);
  count = static_cast<pb_size_t>(values.size());
}

void set_sample_count(Telemetry& batch, pb_size_t count) {
  batch.position_m_count = batch.velocity_m_s_count = batch.acceleration_m_s2_count = count;
  batch.duty_count = batch.impedance_mv_count = batch.reference_m_count = count;
}

Controller paper_controller() {
  Controller controller = rheonaut_Controller_init_zero;
  controller.controller_id = 1;
  controller.checksum = 3'099'722'980;
  controller.period_us = 10'000;
  controller.kp = 65.0028F;
  controller.direct = 117.11186F;
  set_column(controller.pole, controller.pole_count, {-0.4649264F, -0.1022562F, 0.4380344F, 0.8222267F, 0.970841F});
  set_column(controller.residue, controller.residue_count,
             {-29.9971855F, -14.5876807F, -5.3258752F, -1.0051928F, -0.0781306F});
  controller.duty_min = -1;
  controller.duty_max = 1;
  return controller;
}

Controller biquad_controller() {
  Controller controller = rheonaut_Controller_init_zero;
  controller.controller_id = 2;
  controller.checksum = 2'356'539'864;
  controller.period_us = 10'000;
  controller.kp = 30;
  controller.direct = 40;
  set_column(controller.pole, controller.pole_count, {0.5F});
  set_column(controller.residue, controller.residue_count, {-3});
  set_column(controller.biquad_b0, controller.biquad_b0_count, {0.25F});
  set_column(controller.biquad_b1, controller.biquad_b1_count, {0.125F});
  set_column(controller.biquad_a1, controller.biquad_a1_count, {-1.5F});
  set_column(controller.biquad_a2, controller.biquad_a2_count, {0.625F});
  controller.duty_max = 1;
  controller.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT;
  return controller;
}

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

void build_welcomes(Built& built) {
  auto frame = from_station(rheonaut_StationFrame_welcome_tag);
  Welcome& welcome = frame.body.welcome;
  welcome.protocol_version = kProtocolVersion;
  welcome.store_id = 4'660'046'610'375'530'309;
  welcome.link_timeout_ms = kDefaultLinkTimeoutMs;
  welcome.heartbeat_interval_ms = kDefaultHeartbeatIntervalMs;
  welcome.samples_per_frame = 5;
  welcome.utc_us = 1'767'225'600'000'000;
  built["welcome"] = framed(frame);
  welcome.durable_next_seq = 1400;
  welcome.durable_next_event_seq = 3;
  welcome.samples_per_frame = kMaxSamplesPerFrame;
  welcome.utc_us = 1'767'225'614'500'000;
  built["welcome_back"] = framed(frame);

  welcome = rheonaut_Welcome_init_zero;
  welcome.protocol_version = kProtocolVersion;
  welcome.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  set_text(welcome.detail, "the token of robot swimmer-1 does not match");
  built["welcome_refused"] = framed(frame);

  welcome.protocol_version = kMax32;
  welcome.refusal = rheonaut_REFUSAL_REASON_STATION_BUSY;
  std::string detail(127, '0');
  for (std::size_t i = 0; i < detail.size(); ++i) detail[i] = static_cast<char>('0' + i % 10);
  set_text(welcome.detail, detail);
  welcome.store_id = welcome.durable_next_seq = welcome.durable_next_event_seq = kMax64;
  welcome.link_timeout_ms = welcome.heartbeat_interval_ms = welcome.samples_per_frame = kMax32;
  welcome.utc_us = std::numeric_limits<std::int64_t>::min();
  built["welcome_limits"] = framed(frame);
}

void build_setpoint_commands(Built& built) {
  auto frame = command(rheonaut_Command_set_mode_tag, 1);
  frame.body.command.action.set_mode = {rheonaut_MODE_AUTO, true, 0.1F};
  built["set_mode_auto"] = framed(frame);
  frame.body.command.action.set_mode = {rheonaut_MODE_AUTO, true, 0};
  built["set_mode_auto_at_zero"] = framed(frame);
  frame.body.command.action.set_mode = {rheonaut_MODE_MANUAL, false, 0};
  built["set_mode_manual"] = framed(frame);

  frame = command(rheonaut_Command_set_setpoint_tag, 2);
  frame.body.command.action.set_setpoint.setpoint_m = 0.05F;
  built["set_setpoint"] = framed(frame);
  frame.body.command.has_execute_at_robot_us = true;
  built["set_setpoint_timed_at_zero"] = framed(frame);
  frame.body.command.execute_at_robot_us = 5'000'000;
  frame.body.command.action.set_setpoint.setpoint_m = -0.025F;
  built["set_setpoint_timed"] = framed(frame);
  frame.body.command.has_execute_at_robot_us = false;
  frame.body.command.action.set_setpoint.setpoint_m = std::bit_cast<float>(0x7FC0'0000U);  // NaN
  built["set_setpoint_not_finite"] = framed(frame);
}

void build_duty_commands(Built& built) {
  auto frame = command(rheonaut_Command_set_duty_tag, 3);
  frame.body.command.action.set_duty = {0.3F, kLeaseMs};
  built["set_duty"] = framed(frame);
  frame.body.command.action.set_duty = {-1, 0};
  built["set_duty_default_lease"] = framed(frame);

  frame = command(rheonaut_Command_renew_lease_tag, 4);
  built["renew_lease_default"] = framed(frame);
  frame.body.command.action.renew_lease.lease_ms = kLeaseMs;
  built["renew_lease"] = framed(frame);

  frame = command(rheonaut_Command_set_duty_schedule_tag, 5);
  auto& schedule = frame.body.command.action.set_duty_schedule;
  schedule.tick_count = 3;
  schedule.tick[1] = 500;
  schedule.tick[2] = 1000;
  set_column(schedule.duty, schedule.duty_count, {0.3F, -0.3F, 0});
  built["set_duty_schedule"] = framed(frame);

  Command& longest = frame.body.command;
  longest.command_id = longest.boot_id = longest.valid_until_robot_us = longest.execute_at_robot_us = kMax64;
  longest.has_execute_at_robot_us = true;
  schedule.tick_count = schedule.duty_count = 64;
  for (std::uint32_t i = 0; i < 64; ++i) {
    schedule.tick[i] = kMax32 - 63 + i;
    schedule.duty[i] = i < 63 ? 1 - static_cast<float>(i) / 32 : 0;
  }
  built["set_duty_schedule_full"] = framed(frame);
}

void build_emergency_commands(Built& built) {
  auto frame = command(rheonaut_Command_emergency_stop_tag, 7);
  frame.body.command.boot_id = frame.body.command.valid_until_robot_us = 0;
  built["emergency_stop"] = framed(frame);
  frame = command(rheonaut_Command_clear_emergency_tag, 8);
  frame.body.command.action.clear_emergency.emergency_id = kEmergency;
  built["clear_emergency"] = framed(frame);
}

void build_settings_commands(Built& built) {
  auto frame = command(rheonaut_Command_set_controller_tag, 9);
  frame.body.command.action.set_controller = paper_controller();
  built["set_controller"] = framed(frame);
  frame.body.command.action.set_controller = biquad_controller();
  built["set_controller_biquads"] = framed(frame);
  built["restore_controller"] = framed(command(rheonaut_Command_restore_controller_tag, 10));

  frame = command(rheonaut_Command_get_parameters_tag, 11);
  built["get_parameters"] = framed(frame);
  frame.body.command.action.get_parameters.first_index = 6;
  built["get_parameters_from_6"] = framed(frame);
  frame = command(rheonaut_Command_set_parameter_tag, 12);
  frame.body.command.action.set_parameter = {"impedance_nominal_mv", 180};
  built["set_parameter"] = framed(frame);
}

void build_other_commands(Built& built) {
  auto frame = command(rheonaut_Command_inject_disturbance_tag, 13);
  frame.body.command.has_execute_at_robot_us = true;
  frame.body.command.execute_at_robot_us = 5'400'000;
  frame.body.command.action.inject_disturbance.disturbance_m = -0.05F;
  built["inject_disturbance"] = framed(frame);
  built["zero_position"] = framed(command(rheonaut_Command_zero_position_tag, 14));
  built["ping"] = framed(command(rheonaut_Command_ping_tag, 15));
  built["drop_timed"] = framed(command(rheonaut_Command_drop_timed_tag, 17));
  built["command_without_action"] = framed(command(0, 16));
}

Built build_all() {
  Built built;
  build_hello(built);
  build_heartbeats(built);
  build_small_batches(built);
  build_auto_batches(built);
  build_events(built);
  build_status_and_acks(built);
  build_parameters_and_controller(built);
  build_welcomes(built);
  build_setpoint_commands(built);
  build_duty_commands(built);
  build_emergency_commands(built);
  build_settings_commands(built);
  build_other_commands(built);
  return built;
}

// CRC-32 (IEEE), bit by bit.
std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = kMax32;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB8'8320U : 0);
  }
  return ~crc;
}

// The bytes that Controller.checksum covers: fields 3 to 14, 4 bytes each, little-endian.
ByteVector checksummed_bytes(const Controller& controller) {
  ByteVector bytes;
  const auto append = [&](std::uint32_t word) {
    for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(word >> shift));
  };
  const auto append_all = [&](const float* values, pb_size_t count) {
    for (pb_size_t i = 0; i < count; ++i) append(std::bit_cast<std::uint32_t>(values[i]));
  };
  append(controller.period_us);
  append_all(&controller.kp, 1);
  append_all(&controller.direct, 1);
  append_all(controller.pole, controller.pole_count);
  append_all(controller.residue, controller.residue_count);
  append_all(controller.biquad_b0, controller.biquad_b0_count);
  append_all(controller.biquad_b1, controller.biquad_b1_count);
  append_all(controller.biquad_a1, controller.biquad_a1_count);
  append_all(controller.biquad_a2, controller.biquad_a2_count);
  append_all(&controller.duty_min, 1);
  append_all(&controller.duty_max, 1);
  append(static_cast<std::uint32_t>(controller.derivative_on));
  return bytes;
}

std::string hex(const ByteVector& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 0xF];
    text += ' ';
  }
  return text;
}

TEST(GoldenFrames, EveryMessageBuiltFromCodeHasTheBytesOfTheFile) {
  const Built built = build_all();
  const auto golden = read_golden_frames();
  EXPECT_EQ(built.size(), golden.size());
  for (const GoldenFrame& frame : golden) {
    const auto found = built.find(frame.name);
    ASSERT_NE(found, built.end()) << frame.name << " is in the file but not built here";
    EXPECT_EQ(hex(found->second), hex(frame.bytes)) << frame.name;
  }
}

TEST(GoldenFrames, DecodingAndEncodingAgainGivesTheSameBytes) {
  for (const GoldenFrame& golden : read_golden_frames()) {
    const ByteVector payload = golden.payload();
    if (golden.from_robot) {
      const auto frame = decode_robot_frame({payload.data(), payload.size()});
      ASSERT_TRUE(frame.has_value()) << golden.name;
      EXPECT_EQ(hex(framed(*frame)), hex(golden.bytes)) << golden.name;
    } else {
      const auto frame = decode_station_frame({payload.data(), payload.size()});
      ASSERT_TRUE(frame.has_value()) << golden.name;
      EXPECT_EQ(hex(framed(*frame)), hex(golden.bytes)) << golden.name;
    }
  }
}

TEST(GoldenFrames, ControllersCarryTheChecksumOfTheirCoefficients) {
  for (const Controller& controller : {paper_controller(), biquad_controller()}) {
    EXPECT_EQ(crc32(checksummed_bytes(controller)), controller.checksum) << "controller " << controller.controller_id;
  }
}

}  // namespace
}  // namespace protocol
