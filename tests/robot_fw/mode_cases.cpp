// States, commands and events, one line each where one will do.
#include "tests/robot_fw/mode_cases.hpp"

#include <limits>

#include "sim_robot/world/plant.hpp"
#include "tests/robot_fw/controllers.hpp"

namespace robot_fw {
namespace {

constexpr float kDisturbanceM = 0.001F;
constexpr float kSetpointM = 0.09F;
constexpr float kGlucoseMv = 120;
constexpr std::uint32_t kScheduleTicks = 300;

void set(BareCore& core, const char* name, float value) {
  EXPECT_EQ(core.order(sim_robot::set_parameter(name, value)).result, rheonaut_COMMAND_RESULT_ACCEPTED) << name;
}
void accept(BareCore& core, const protocol::Command& command) {
  const auto ack = core.order(command);
  EXPECT_EQ(ack.result, rheonaut_COMMAND_RESULT_ACCEPTED) << protocol::text(ack.reason);
}
protocol::Command schedule() {
  protocol::Command command = BareCore::command_of(rheonaut_Command_set_duty_schedule_tag);
  auto& order = command.action.set_duty_schedule;
  order.tick_count = order.duty_count = 2;
  order.tick[1] = kScheduleTicks;
  order.duty[0] = kScheduleDuty;
  return command;
}
void clear(BareCore& core) { accept(core, sim_robot::clear_emergency(core.robot.emergency_id())); }

// Time passes and the robot stays where it is.
void wait(BareCore& core, int ticks) {
  core.known_position_m = core.sample.position_m[0] - core.sample.disturbance_m;
  core.run(ticks);
}

// Ways into a state.
void drive(BareCore& core, float duty) {
  accept(core, sim_robot::set_duty(duty));
  core.tick();
}
void run_schedule(BareCore& core) {
  accept(core, schedule());
  core.tick();
}
// The accelerometer says what the duty makes of the robot, until that has come to rest.
void drive_outside(BareCore& core) {
  set(core, "model_confirmed", 1);  // the position is known so well that the robot coasts beyond the limit
  set(core, "model_gain_error", 0.01F);
  set(core, "model_shape_error", 0.03F);
  sim_robot::Plant plant{sim_robot::PlantParameters{}, 0.01};
  const auto swim = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      plant.step(static_cast<double>(core.robot.duty()));
      core.mean_counts = static_cast<int>(100 * plant.acceleration_m_s2());
      core.tick();
    }
  };
  drive(core, 1);
  for (int i = 0; i < 1000 && core.robot.mode() == rheonaut_MODE_MANUAL; ++i) swim(1);
  EXPECT_EQ(core.sample.emergency_cause, rheonaut_EMERGENCY_CAUSE_POSITION_LIMIT);
  swim(100);
  core.mean_counts = 0;
  clear(core);
  core.tick();
}
// In auto, where the position is 0 and a disturbance shifts it; the robot is let go at the end.
void go_auto(BareCore& core, float setpoint_m, int ticks) {
  accept(core, sim_robot::set_auto(setpoint_m));
  accept(core, sim_robot::inject_disturbance(kDisturbanceM));
  core.known_position_m = 0.0F;
  core.run(ticks);
  core.known_position_m.reset();
}
void navigate(BareCore& core) { go_auto(core, kSetpointM, 2); }
void hold(BareCore& core) { go_auto(core, 0, 60); }
void deliver(BareCore& core) {
  core.impedance_mv = kGlucoseMv;
  go_auto(core, kSetpointM, 30);
}
void stop(BareCore& core) {
  accept(core, sim_robot::emergency_stop());
  core.tick();
}
void leave_limits(BareCore& core) {
  core.known_position_m = kLimitM + 0.05F;
  core.tick();
}
void come_inside(BareCore& core) {
  core.known_position_m = 0.0F;
  core.tick();
}
void overheat(BareCore& core) {
  set(core, "power_limit_s", 0.3F);
  drive(core, 1);
  core.run(31);
}
void break_input(BareCore& core) {
  core.supply_mv = std::numeric_limits<float>::quiet_NaN();
  core.tick();
  core.supply_mv = 3000;
  core.tick();
}
void lose_accelerometer(BareCore& core) {
  core.accelerometer_answers = false;
  core.run(25);
}
void stick_accelerometer(BareCore& core) {
  core.accelerometer_answers = true;
  core.steady_counts = std::int16_t{0};
  core.run(100);
}
void overload_accelerometer(BareCore& core) {
  core.accelerometer_answers = true;
  core.steady_counts.reset();
  core.swing_counts = 4000;
  core.run(5);
}
void lose_electrode(BareCore& core) {
  core.impedance_mv = 0;
  core.run(5);
}
void recover(BareCore& core) {
  core.accelerometer_answers = true;
  core.steady_counts.reset();
  core.swing_counts = 1;
  if (core.impedance_mv < 20) core.impedance_mv = 175;
  core.run(101);
}

// Events.
void lose_link(BareCore& core, int ticks) {
  core.attentive = false;
  core.run(ticks);
  core.attentive = true;
}
void reset(BareCore& core, protocol::ResetCause cause, bool keeps_latch) {
  RobotConfig config = BareCore::config();
  config.boot_id = BareCore::kBootId;
  config.reset_cause = cause;
  if (keeps_latch) {
    config.restored_emergency_id = core.robot.emergency_id();
    config.restored_emergency_cause = core.sample.emergency_cause;
  }
  core = BareCore{config};
  EXPECT_EQ(core.robot.duty(), 0);
  core.tick();
}

}  // namespace

const std::vector<StateCase> kStateCases{
    {"rest", "rest", [](BareCore& core) { core.tick(); }},
    {"duty", "duty", [](BareCore& core) { drive(core, kManualDuty); }},
    {"schedule", "schedule", run_schedule},
    {"outside", "outside", drive_outside},
    {"faulty", "faulty", lose_accelerometer},
    {"navigating", "navigating", navigate},
    {"holding", "holding", hold},
    {"delivering", "delivering", deliver},
    {"operator", "emergency", stop},
    {"position_limit", "emergency",
     [](BareCore& core) { leave_limits(core), come_inside(core), core.known_position_m.reset(); }},
    {"time_at_power", "emergency", overheat},
    {"internal_error", "emergency", break_input},
    {"watchdog", "emergency", [](BareCore& core) { core.tick(); }, rheonaut_RESET_CAUSE_WATCHDOG},
    {"sensor_missing", "sensor", [](BareCore& core) { navigate(core), lose_accelerometer(core); }},
    {"recovered_missing", "recovered", [](BareCore& core) { navigate(core), lose_accelerometer(core), recover(core); }},
    {"recovered_stuck", "recovered", [](BareCore& core) { navigate(core), stick_accelerometer(core), recover(core); }},
    {"recovered_range", "recovered",
     [](BareCore& core) { navigate(core), overload_accelerometer(core), recover(core); }},
    {"recovered_electrode", "recovered", [](BareCore& core) { navigate(core), lose_electrode(core), recover(core); }},
};

const std::vector<CommandCase> kCommandCases{
    {"set_mode manual", [](const BareCore&) { return sim_robot::set_manual(); }},
    {"set_mode auto", [](const BareCore&) { return sim_robot::set_auto(0.05F); }},
    {"set_mode auto, beyond the limits", [](const BareCore&) { return sim_robot::set_auto(2 * kLimitM); }},
    {"set_setpoint", [](const BareCore&) { return sim_robot::set_setpoint(0.05F); }},
    {"set_setpoint beyond the limits", [](const BareCore&) { return sim_robot::set_setpoint(2 * kLimitM); }},
    {"set_duty 0", [](const BareCore&) { return sim_robot::set_duty(0); }},
    {"set_duty forwards", [](const BareCore&) { return sim_robot::set_duty(0.4F); }},
    {"set_duty backwards", [](const BareCore&) { return sim_robot::set_duty(-0.4F); }},
    {"set_duty_schedule forwards", [](const BareCore&) { return schedule(); }},
    {"renew_lease", [](const BareCore&) { return sim_robot::renew_lease(); }},
    {"emergency_stop", [](const BareCore&) { return sim_robot::emergency_stop(); }},
    {"clear_emergency with its id",
     [](const BareCore& core) { return sim_robot::clear_emergency(core.robot.emergency_id()); }},
    {"clear_emergency with another id",
     [](const BareCore& core) { return sim_robot::clear_emergency(core.robot.emergency_id() + 1); }},
    {"inject_disturbance", [](const BareCore&) { return sim_robot::inject_disturbance(-kDisturbanceM); }},
    {"zero_position", [](const BareCore&) { return sim_robot::zero_position(); }},
    {"set_controller", [](const BareCore&) { return sim_robot::set_controller(biquad_controller()); }},
    {"restore_controller", [](const BareCore&) { return sim_robot::restore_controller(); }},
    {"set_parameter, one for any time",
     [](const BareCore&) { return sim_robot::set_parameter("setpoint_limit_m", 0.5F); }},
    {"set_parameter, one for rest", [](const BareCore&) { return sim_robot::set_parameter("power_limit_s", 7); }},
    {"get_parameters", [](const BareCore&) { return sim_robot::get_parameters(0); }},
    {"ping", [](const BareCore&) { return sim_robot::ping(); }},
    {"drop_timed", [](const BareCore&) { return sim_robot::drop_timed(); }},
    {"an unknown action", [](const BareCore&) { return BareCore::command_of(0); }},
};

const std::vector<EventCase> kEventCases{
    {"link lost, link_loss_action stop", {}, [](BareCore& core) { lose_link(core, 12); }},
    {"link lost, hold", {{"link_loss_action", 1}}, [](BareCore& core) { lose_link(core, 12); }},
    {"link lost, go_on", {{"link_loss_action", 2}}, [](BareCore& core) { lose_link(core, 12); }},
    {"link lost, go_on, for link_loss_limit_s",
     {{"link_loss_action", 2}, {"link_loss_limit_s", 0.2F}},
     [](BareCore& core) { lose_link(core, 32); }},
    {"link lost, go_on, and restored",
     {{"link_loss_action", 2}, {"link_loss_limit_s", 0.2F}},
     [](BareCore& core) {
       lose_link(core, 12);
       core.heartbeat();
       wait(core, 30);
     }},
    {"lease lapses", {}, [](BareCore& core) { core.renews = false, wait(core, 51); }},
    {"schedule ends", {}, [](BareCore& core) { wait(core, kScheduleTicks + 1); }},
    {"auto_limit_s is over", {{"auto_limit_s", 2}}, [](BareCore& core) { wait(core, 201); }},
    {"at the setpoint for 0.5 s",
     {},
     [](BareCore& core) {
       if (core.sample.has_setpoint_m) core.known_position_m = core.sample.setpoint_m - core.sample.disturbance_m;
       core.run(51);
     }},
    {"away from the setpoint",
     {},
     [](BareCore& core) {
       if (core.sample.has_setpoint_m) core.known_position_m = core.sample.setpoint_m - 0.02F;
       core.tick();
     }},
    {"glucose", {}, [](BareCore& core) { core.impedance_mv = kGlucoseMv, core.run(5); }},
    {"glucose has mixed", {}, [](BareCore& core) { core.impedance_mv = 175, wait(core, 51); }},
    {"delivery_limit_s is over", {{"delivery_limit_s", 1}}, [](BareCore& core) { wait(core, 101); }},
    {"leaves the position limits", {}, leave_limits},
    {"comes back inside", {}, come_inside},
    {"too long at power",
     {{"power_limit_duty", 0.1F}, {"power_limit_s", 2.5F}},
     [](BareCore& core) { wait(core, 255); }},
    {"accelerometer missing", {}, lose_accelerometer},
    {"accelerometer stuck", {}, stick_accelerometer},
    {"accelerometer out of range", {}, overload_accelerometer},
    {"electrode out of range", {}, lose_electrode},
    {"accelerometer recovers", {}, recover},
    {"an input is not finite", {}, break_input},
    {"the clock goes back",
     {},
     [](BareCore& core) {
       Inputs earlier = core.inputs();
       earlier.robot_time_us -= BareCore::kTickUs;
       core.step(earlier);
       core.step(core.inputs());  // the time at which it went back
     }},
    {"the motor's supply is cut, and comes back",
     {},
     [](BareCore& core) {
       core.motor_supply_is_cut = true;
       core.run(20);
       core.motor_supply_is_cut = false;
       core.tick();
     }},
    {"reset: power on", {}, [](BareCore& core) { reset(core, rheonaut_RESET_CAUSE_POWER_ON, false); }},
    {"reset: software", {}, [](BareCore& core) { reset(core, rheonaut_RESET_CAUSE_SOFTWARE, true); }},
    {"reset: external", {}, [](BareCore& core) { reset(core, rheonaut_RESET_CAUSE_EXTERNAL, true); }},
    {"reset: watchdog", {}, [](BareCore& core) { reset(core, rheonaut_RESET_CAUSE_WATCHDOG, true); }},
    {"reset: brown-out", {}, [](BareCore& core) { reset(core, rheonaut_RESET_CAUSE_BROWN_OUT, true); }},
};

BareCore prepared(const StateCase& state, const ParameterValues& parameters) {
  RobotConfig config = BareCore::config();
  config.reset_cause = state.reset_cause;
  BareCore core{config};
  core.tick();
  set(core, "position_limit_min_m", -kLimitM);
  set(core, "position_limit_max_m", kLimitM);
  core.tick();
  for (const auto& [name, value] : parameters) set(core, name, value);
  // So that restore_controller has one to go back to; an emergency would refuse it.
  if (core.robot.emergency_id() == 0) accept(core, sim_robot::set_controller(paper_controller()));
  core.tick();
  state.enter(core);
  return core;
}

bool is_reason(const std::string& cell) {
  for (int reason = rheonaut_REJECT_REASON_MALFORMED; reason <= rheonaut_REJECT_REASON_UNSUPPORTED; ++reason) {
    if (cell == protocol::text(static_cast<protocol::RejectReason>(reason))) return true;
  }
  return false;
}

}  // namespace robot_fw
