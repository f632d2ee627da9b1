// Every message that a station sends, built from code.
#include "golden_builders.hpp"

namespace protocol {
namespace {

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

}  // namespace

void build_station_frames(Built& built) {
  build_welcomes(built);
  build_setpoint_commands(built);
  build_duty_commands(built);
  build_emergency_commands(built);
  build_settings_commands(built);
  build_other_commands(built);
}

}  // namespace protocol
