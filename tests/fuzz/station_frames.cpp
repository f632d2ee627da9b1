// Builds frames in which most fields are plausible and some are not.
#include "tests/fuzz/station_frames.hpp"

#include <algorithm>

#include "robot_fw/core/parameters.hpp"
#include "tests/robot_fw/controllers.hpp"

namespace fuzz {
namespace {

// A seq near the end, near the start of the ring, or anywhere.
std::uint64_t seq(ByteSource& source, const KnownOfRobot& robot) {
  const std::uint8_t choice = source.byte();
  if (choice < 100) return robot.next_seq - std::min<std::uint64_t>(robot.next_seq, choice);
  if (choice < 200) return choice - 100U;
  if (choice < 250) return robot.next_seq - std::min<std::uint64_t>(robot.next_seq, 16ULL * (choice - 200U));
  return source.number<std::uint64_t>();
}

protocol::Controller controller(ByteSource& source) {
  const std::uint8_t choice = source.byte();
  protocol::Controller controller =
      choice % 2 == 0 ? robot_fw::biquad_controller() : robot_fw::scaled_controller(choice, 1.5F);
  if (choice & 2) controller.duty_max = 0.5F;
  if (choice & 4) controller.duty_min = -0.4F;
  if (choice & 8) controller.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT;
  if (choice & 16) {
    float* numbers[] = {&controller.kp,           &controller.direct,       &controller.pole[0],
                        &controller.residue[0],   &controller.biquad_b0[0], &controller.biquad_b1[0],
                        &controller.biquad_a1[0], &controller.biquad_a2[0], &controller.duty_min,
                        &controller.duty_max};
    float* changed = numbers[source.byte() % std::size(numbers)];
    *changed = source.value();
  }
  if (choice & 32) controller.pole_count = source.byte() % 11;
  if (choice & 64) controller.biquad_b0_count = source.byte() % 6;
  return choice & 128 ? controller : robot_fw::with_checksum(controller);
}

void fill_schedule(ByteSource& source, rheonaut_SetDutySchedule& schedule) {
  schedule.tick_count = source.byte() % 65;
  schedule.duty_count = schedule.tick_count;
  std::uint32_t tick = 0;
  for (pb_size_t i = 0; i < schedule.tick_count; ++i) {
    schedule.tick[i] = tick;
    schedule.duty[i] = i + 1 == schedule.tick_count ? 0 : source.value();
    tick += source.byte();
  }
}

void fill_parameter(ByteSource& source, rheonaut_SetParameter& order) {
  const std::uint8_t choice = source.byte();
  const robot_fw::ParameterSpec& spec = robot_fw::Parameters::spec(choice % robot_fw::kParameterCount);
  std::strncpy(order.name, spec.name, sizeof order.name - 1);
  const float share = static_cast<float>(source.byte()) / 255;
  order.value = choice < 200 ? spec.minimum + share * share * (spec.maximum - spec.minimum) : source.value();
}

void fill_action(ByteSource& source, std::uint8_t choice, const KnownOfRobot& robot, protocol::Command& command) {
  auto& action = command.action;
  const auto is = [&command](pb_size_t tag) { command.which_action = tag; };
  switch (choice % 16) {
    case 0: return is(rheonaut_Command_emergency_stop_tag);
    case 1:
    case 2:
      is(rheonaut_Command_set_mode_tag);
      action.set_mode.mode = choice % 16 == 1 ? rheonaut_MODE_MANUAL : rheonaut_MODE_AUTO;
      action.set_mode.has_setpoint_m = choice % 16 == 2;
      if (choice & 0x80) action.set_mode.mode = static_cast<protocol::Mode>(source.byte() % 8);
      if (action.set_mode.has_setpoint_m) action.set_mode.setpoint_m = source.value();
      return;
    case 3: is(rheonaut_Command_set_setpoint_tag); return void(action.set_setpoint.setpoint_m = source.value());
    case 4:
    case 5:
      is(rheonaut_Command_set_duty_tag);
      action.set_duty.duty = source.value();
      action.set_duty.lease_ms = source.byte() * 2U;
      return;
    case 6: is(rheonaut_Command_renew_lease_tag); return void(action.renew_lease.lease_ms = source.byte() * 2U);
    case 7: is(rheonaut_Command_set_duty_schedule_tag); return fill_schedule(source, action.set_duty_schedule);
    case 8:
    case 9:
      is(rheonaut_Command_clear_emergency_tag);
      action.clear_emergency.emergency_id = choice & 0x80 ? source.number<std::uint64_t>() : robot.emergency_id;
      return;
    case 10: is(rheonaut_Command_set_controller_tag); return void(action.set_controller = controller(source));
    case 11: return is(rheonaut_Command_restore_controller_tag);
    case 12: is(rheonaut_Command_set_parameter_tag); return fill_parameter(source, action.set_parameter);
    case 13: is(rheonaut_Command_get_parameters_tag); return void(action.get_parameters.first_index = source.byte());
    case 14:
      is(rheonaut_Command_inject_disturbance_tag);
      return void(action.inject_disturbance.disturbance_m = source.value());
    default:
      if (choice & 0x40) return is(rheonaut_Command_drop_timed_tag);
      return is(choice & 0x80 ? rheonaut_Command_ping_tag : rheonaut_Command_zero_position_tag);
  }
}

}  // namespace

protocol::StationFrame welcome(ByteSource& source, const KnownOfRobot& robot) {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  auto& welcome = frame.body.welcome;
  const std::uint8_t choice = source.byte();
  welcome.protocol_version = choice == 0xFF ? 2 : protocol::kProtocolVersion;
  if (choice == 0xFE) welcome.refusal = static_cast<protocol::RefusalReason>(source.byte());
  if (choice & 1) welcome.durable_next_seq = seq(source, robot);
  if (choice & 2) welcome.durable_next_event_seq = source.byte();
  if (choice & 4) welcome.link_timeout_ms = source.number<std::uint16_t>();
  if (choice & 8) welcome.heartbeat_interval_ms = source.number<std::uint16_t>();
  welcome.samples_per_frame = choice >> 4;
  return frame;
}

protocol::StationFrame heartbeat(ByteSource& source, const KnownOfRobot& robot) {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  auto& heartbeat = frame.body.heartbeat;
  const std::uint8_t choice = source.byte();
  if (choice & 1) heartbeat.station_time_us = 1 + source.byte();
  if (choice & 2) heartbeat.durable_next_seq = seq(source, robot);
  if (choice & 4) heartbeat.durable_next_event_seq = source.byte();
  if (choice & 8) {
    heartbeat.resend_first_seq = seq(source, robot);
    heartbeat.resend_next_seq = seq(source, robot);
  }
  heartbeat.resend_events = (choice & 16) != 0;
  return frame;
}

protocol::Command command(ByteSource& source, const KnownOfRobot& robot) {
  protocol::Command command = rheonaut_Command_init_zero;
  const std::uint8_t choice = source.byte(), identity = source.byte();
  fill_action(source, choice, robot, command);
  command.command_id = 1 + source.byte();
  command.boot_id = robot.boot_id;
  command.valid_until_robot_us = robot.now_us + 1'000'000;
  if (identity & 1) {
    command.has_execute_at_robot_us = true;
    command.execute_at_robot_us = robot.now_us + source.byte() * 4'000ULL;
  }
  if (identity & 2) command.valid_until_robot_us = robot.now_us + source.byte() * 50'000ULL;
  if (identity < 192) return command;
  switch (identity % 16 / 4) {  // the rest is wrong in one way
    case 0: command.command_id = source.number<std::uint64_t>(); break;
    case 1: command.boot_id = source.number<std::uint64_t>(); break;
    case 2: command.valid_until_robot_us = source.number<std::uint64_t>(); break;
    default: command.which_action = 0; break;
  }
  return command;
}

protocol::StationFrame frame_of(const protocol::Command& command) {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = command;
  return frame;
}

}  // namespace fuzz
