// An emergency stop acts between ticks, latches, and is undone by nothing but a clear that names it.
#include <cmath>
#include <limits>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;
using Emergency = DrivenRobot;

TEST_F(Emergency, StopsTheMotorBetweenTicks) {
  order(set_duty(0.5F));
  ASSERT_EQ(core().duty(), 0.5F);
  station.send(emergency_stop());
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(mode(), "emergency");
  EXPECT_NE(core().emergency_id(), 0u);
  station.listen();
  ASSERT_EQ(station.frames.back().which_body, pb_size_t{rheonaut_RobotFrame_event_tag});
  EXPECT_EQ(station.acks.back().emergency_id, core().emergency_id());
  station.step();
  EXPECT_EQ(last().duty, 0);
  EXPECT_EQ(last().emergency_id, core().emergency_id());
}

TEST_F(Emergency, StopsAutoAndLeavesNoSetpoint) {
  order(set_auto(0.1F));
  station.send(emergency_stop());
  EXPECT_EQ(core().duty(), 0);
  station.step();
  EXPECT_FALSE(last().setpoint_m.has_value());
}

TEST_F(Emergency, IsObeyedWithoutBootIdLifeOrCommandId) {
  order(set_duty(0.5F));
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = emergency_stop();  // everything else is 0
  EXPECT_TRUE(station.send(frame));
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(mode(), "emergency");
}

TEST_F(Emergency, IsObeyedBeforeWelcome) {
  SimulatedRobot other{with_boot_id({})};
  StationPeer peer{other};
  other.link_opened(0);
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = emergency_stop();
  EXPECT_TRUE(peer.send(frame));
  EXPECT_NE(other.core().emergency_id(), 0u);
  peer.listen();
  ASSERT_EQ(peer.frames.size(), 2u);  // nothing but hello and this ack before Welcome
  EXPECT_TRUE(peer.hello.has_value());
  EXPECT_EQ(peer.acks.size(), 1u);
}

TEST_F(Emergency, EveryStopGivesANewId) {
  order(emergency_stop());
  const auto first = core().emergency_id();
  order(emergency_stop());
  EXPECT_NE(core().emergency_id(), first);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_EMERGENCY), 2);
}

TEST_F(Emergency, AClearOvertakenByASecondStopDoesNothing) {
  order(emergency_stop());
  const auto first = core().emergency_id();
  order(emergency_stop());
  EXPECT_EQ(answer(clear_emergency(first)), "other_emergency");
  EXPECT_EQ(mode(), "emergency");
  EXPECT_EQ(answer(clear_emergency(0)), "other_emergency");
  EXPECT_EQ(mode(), "emergency");
}

TEST_F(Emergency, AClearThatNamesItLeavesTheRobotAtRest) {
  order(set_auto(0.1F));
  order(emergency_stop());
  EXPECT_EQ(answer(clear_emergency(core().emergency_id())), "accepted");
  expect_at_rest();
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_EMERGENCY_CLEARED), 1);
}

TEST_F(Emergency, ARepeatedStopIsADuplicateButLatchesAgainAfterAClear) {
  protocol::Command stop = emergency_stop();
  stop.command_id = 77;
  order(stop);
  const auto id = core().emergency_id();
  const auto repeated = order(stop);
  EXPECT_EQ(result(repeated), "duplicate");
  EXPECT_EQ(repeated.emergency_id, id);
  EXPECT_EQ(core().emergency_id(), id);
  order(clear_emergency(id));
  const auto anew = order(stop);
  EXPECT_EQ(result(anew), "accepted");
  EXPECT_EQ(mode(), "emergency");
  EXPECT_NE(core().emergency_id(), id);
  EXPECT_EQ(anew.emergency_id, core().emergency_id());
}

TEST_F(Emergency, ARepeatedStopNamesTheEmergencyInForce) {
  protocol::Command stop = emergency_stop();
  stop.command_id = 77;
  order(stop);
  order(emergency_stop());
  const auto in_force = core().emergency_id();
  for (int second = 0; second < 3; ++second) {
    const auto repeated = order(stop);
    EXPECT_EQ(result(repeated), "duplicate");
    EXPECT_EQ(repeated.emergency_id, in_force);
    station.run(100);
  }
  EXPECT_EQ(core().emergency_id(), in_force);
}

TEST_F(Emergency, RefusesEveryMotionWhileLatched) {
  order(emergency_stop());
  for (const auto& command : {set_auto(0.1F), set_manual(), set_setpoint(0.1F), set_duty(0.1F), renew_lease(),
                              inject_disturbance(0.1F), zero_position()}) {
    EXPECT_EQ(answer(command), "latched");
    EXPECT_EQ(core().duty(), 0);
  }
  EXPECT_EQ(answer(ping()), "accepted");
}

TEST_F(Emergency, OutlivesTheLink) {
  order(emergency_stop());
  station.disconnect();
  station.run(200);
  EXPECT_EQ(mode(), "emergency");
  station.connect();
  EXPECT_EQ(station.hello->emergency_id, core().emergency_id());
}

TEST_F(Emergency, DropsTimedCommands) {
  protocol::Command later = set_auto(0.1F);
  later.has_execute_at_robot_us = true;
  later.execute_at_robot_us = robot.robot_time_us() + 5 * kTickUs;
  order(later);
  order(emergency_stop());
  order(clear_emergency(core().emergency_id()));
  expect_at_rest();
}

TEST(Boot, ComesUpLatchedAfterAWatchdogOrBrownOutReset) {
  for (const auto cause : {rheonaut_RESET_CAUSE_WATCHDOG, rheonaut_RESET_CAUSE_BROWN_OUT}) {
    SimulatedRobotConfig config;
    config.reset_cause = cause;
    SimulatedRobot robot{config};
    EXPECT_EQ(robot.core().mode(), rheonaut_MODE_EMERGENCY);
    StationPeer station{robot};
    station.connect();
    EXPECT_EQ(station.hello->emergency_cause, rheonaut_EMERGENCY_CAUSE_RESET);
    EXPECT_NE(station.hello->emergency_id, 0u);
  }
}

TEST(Boot, TakesOverALatchThatOutlivedTheReset) {
  RobotConfig config;
  config.boot_id = kBootId;
  config.restored_emergency_id = 4711;
  config.restored_emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
  const Robot robot{config};
  EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(robot.emergency_id(), 4711u);
}

TEST(Boot, ASensorThatCausedTheLatchIsNotBelievedAtOnce) {
  RobotConfig config;
  config.boot_id = kBootId;
  config.reset_cause = rheonaut_RESET_CAUSE_SOFTWARE;
  config.restored_emergency_id = 4711;
  config.restored_emergency_cause = rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK;
  Robot robot{config};
  std::uint64_t now_us = 0;
  const auto tick = [&](std::int16_t counts) {
    Inputs inputs;
    inputs.robot_time_us = now_us += kTickUs;
    inputs.impedance_mv = 175;
    inputs.acceleration_is_valid = true;
    inputs.acceleration_counts = counts;
    robot.step(inputs, 0.01F);
  };
  const auto send = [&](protocol::StationFrame frame) {
    std::uint8_t bytes[protocol::kMaxFramedBytes];
    EXPECT_TRUE(robot.receive({bytes, protocol::write_frame(frame, bytes, sizeof bytes)}, now_us));
  };
  std::uint64_t id = 0;
  const auto clear = [&] {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    frame.body.command = clear_emergency(4711);
    frame.body.command.command_id = ++id;
    frame.body.command.boot_id = kBootId;
    frame.body.command.valid_until_robot_us = now_us + 1'000'000;
    send(frame);
  };
  tick(5);
  robot.link_opened(now_us);
  protocol::StationFrame welcome = rheonaut_StationFrame_init_zero;
  welcome.which_body = rheonaut_StationFrame_welcome_tag;
  welcome.body.welcome.protocol_version = protocol::kProtocolVersion;
  send(welcome);
  clear();
  for (int i = 0; i < 300; ++i) tick(5);  // stuck still
  clear();
  EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
  for (std::int16_t i = 0; i < 101; ++i) tick(i);
  clear();
  EXPECT_EQ(robot.mode(), rheonaut_MODE_MANUAL);
}

// A core without a plant, in auto at full duty.
class BareRobot : public ::testing::Test {
 protected:
  BareRobot() : robot(config()) {
    robot.link_opened(0);
    send_welcome();
    send(sim_robot::set_auto(0.5F));
    robot.step(inputs(), 0.01F);
    EXPECT_EQ(robot.duty(), 1);
  }
  static RobotConfig config() {
    RobotConfig config;
    config.boot_id = kBootId;
    return config;
  }
  Inputs inputs() {
    Inputs inputs;
    inputs.robot_time_us = now_us += kTickUs;
    inputs.known_motion = Motion{};
    inputs.impedance_mv = 175;
    return inputs;
  }
  void send_welcome() {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    send(frame);
  }
  void send(protocol::Command command) {
    command.command_id = ++next_id;
    command.boot_id = kBootId;
    command.valid_until_robot_us = now_us + 1'000'000;
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    frame.body.command = command;
    send(frame);
  }
  void send(const protocol::StationFrame& frame) {
    std::uint8_t bytes[protocol::kMaxFramedBytes];
    const std::size_t size = protocol::write_frame(frame, bytes, sizeof bytes);
    EXPECT_TRUE(robot.receive({bytes, size}, now_us));
  }

  std::uint64_t now_us = 0;
  std::uint64_t next_id = 0;
  Robot robot;
};

TEST_F(BareRobot, StopsOnAnyInputThatIsNotFinite) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  using Field = float& (*)(Inputs&);
  for (const Field field : {Field([](Inputs& in) -> float& { return in.known_motion->position_m; }),
                            Field([](Inputs& in) -> float& { return in.known_motion->velocity_m_s; }),
                            Field([](Inputs& in) -> float& { return in.known_motion->acceleration_m_s2; }),
                            Field([](Inputs& in) -> float& { return in.impedance_mv; }),
                            Field([](Inputs& in) -> float& { return in.supply_mv; })}) {
    for (const float bad : {kNan, kInf}) {
      Inputs broken = inputs();
      field(broken) = bad;
      EXPECT_EQ(robot.step(broken, 0.01F).duty, 0);
      EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
      const auto id = robot.emergency_id();
      EXPECT_EQ(robot.step(inputs(), 0.01F).duty, 0);
      EXPECT_EQ(robot.emergency_id(), id);  // one stop, not one per tick
      send(clear_emergency(id));
      send(set_auto(0.5F));
      EXPECT_EQ(robot.step(inputs(), 0.01F).duty, 1);  // no NaN survived in the controller
    }
  }
}

TEST_F(BareRobot, StopsOnATimeStepThatIsNotFinite) {
  EXPECT_EQ(robot.step(inputs(), std::numeric_limits<float>::quiet_NaN()).duty, 0);
  EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
}

TEST_F(BareRobot, StopsWhenTheClockGoesBack) {
  Inputs earlier = inputs();
  earlier.robot_time_us -= 2 * kTickUs;
  EXPECT_EQ(robot.step(earlier, 0.01F).duty, 0);
  EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
}

TEST_F(BareRobot, RefusesAClearWhileTheInputIsStillBroken) {
  Inputs broken = inputs();
  broken.known_motion->position_m = std::numeric_limits<float>::quiet_NaN();
  robot.step(broken, 0.01F);
  send(clear_emergency(robot.emergency_id()));
  EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
}

TEST_F(BareRobot, AutoStopsWhenTheControllerAsksForMoreThanFloatHolds) {
  Inputs far = inputs();
  far.known_motion->position_m = -std::numeric_limits<float>::max();
  EXPECT_EQ(robot.step(far, 0.01F).duty, 0);
  EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
}

}  // namespace
}  // namespace robot_fw
