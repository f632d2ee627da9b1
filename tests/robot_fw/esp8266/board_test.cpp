// The robot on its board, from boot to reset: stops, ticks, inputs, latch, settings, LED.
#include "robot_fw/esp8266/board.hpp"

#include "board_fixture.hpp"

namespace robot_fw::esp8266 {
namespace {

class BoardTest : public BoardFixture {
 protected:
  std::optional<protocol::Status> status() {
    std::optional<protocol::Status> last;
    for (const protocol::RobotFrame& frame : received()) {
      if (frame.which_body == rheonaut_RobotFrame_status_tag) last = frame.body.status;
    }
    return last;
  }
  // As long as the station says something, the link stays.
  void stay_ms(std::uint32_t ms) {
    for (std::uint32_t i = 0; i < ms / 200; ++i) {
      heartbeat();
      run_ms(200);
    }
  }
  std::uint32_t missed_ticks() {
    received();
    stay_ms(1'400);
    const auto last = status();
    EXPECT_TRUE(last.has_value());
    return last.value_or(protocol::Status{}).missed_ticks;
  }
};

TEST_F(BoardTest, DrivesTheMotorByOrder) {
  connect();
  drive(0.5F);
  EXPECT_NEAR(static_cast<double>(motor_high_us([this] { run_ms(100); })), 50'000, 2'000);
}

TEST_F(BoardTest, LeaseThatLapsesTurnsThePinOff) {
  connect();
  drive(0.5F);
  run_ms(600);
  EXPECT_EQ(motor_high_us([this] { run_ms(500); }), 0U);
}

TEST_F(BoardTest, StopBetweenTicksTurnsThePinOffAtOnce) {
  connect();
  drive(1);
  while (!chip.level(kMotorPin)) run_ms(1);
  while (chip.now_us % 10'000 != 3'000) {  // in the middle between two ticks
    chip.pass(kTurnUs);
    board->step();
  }
  ASSERT_TRUE(chip.level(kMotorPin));
  received();
  order(sim_robot::emergency_stop());
  board->step();  // no time has passed, so no tick has run
  EXPECT_FALSE(chip.level(kMotorPin));
  EXPECT_TRUE(board->motor().is_off());
  bool acknowledged = false;
  for (const protocol::RobotFrame& frame : received()) {
    acknowledged |= frame.which_body == rheonaut_RobotFrame_command_ack_tag;
  }
  EXPECT_TRUE(acknowledged) << "in the same turn";
  EXPECT_EQ(board->led_pattern(), LedPattern::emergency);
  EXPECT_EQ(motor_high_us([this] { run_ms(500); }), 0U);
}

TEST_F(BoardTest, BlockedTickTurnsThePinOffAndTheNextOneOn) {
  connect();
  drive(1);
  chip.pass(50'000);
  EXPECT_FALSE(chip.level(kMotorPin));
  EXPECT_EQ(motor_high_us([] { chip.pass(300'000); }), 0U);
  heartbeat();
  run_ms(1);
  EXPECT_TRUE(chip.level(kMotorPin)) << "a tick has completed, and the lease still runs";
  EXPECT_EQ(board->motor().dead_man_trips(), 1U);
}

TEST_F(BoardTest, MissedTicksAreCountedAndReportedAndOneTickRuns) {
  connect();
  const std::uint32_t before = missed_ticks();
  while (chip.now_us % 10'000 != 1'000) {
    chip.pass(kTurnUs);
    board->step();
  }
  const int ticks = chip.watchdog_feeds;
  chip.pass(35'000);
  board->step();
  EXPECT_EQ(chip.watchdog_feeds, ticks + 1);
  board->step();
  EXPECT_EQ(chip.watchdog_feeds, ticks + 1) << "none is caught up";
  EXPECT_EQ(missed_ticks(), before + 2) << "due at 9, 19 and 29 ms of the 35: the last of them ran";
}

TEST_F(BoardTest, InputsReachTheStation) {
  chip.analogue = 180;
  chip.imu_registers[0x35] = 0b00'11'11'00;
  connect();
  received();
  for (int i = 0; i < 3; ++i) {
    heartbeat();
    run_ms(500);
  }
  std::optional<protocol::Status> last;
  float impedance_mv = 0;
  for (const protocol::RobotFrame& frame : received()) {
    if (frame.which_body == rheonaut_RobotFrame_status_tag) last = frame.body.status;
    if (frame.which_body == rheonaut_RobotFrame_telemetry_tag) impedance_mv = frame.body.telemetry.impedance_mv[0];
  }
  ASSERT_TRUE(last.has_value());
  EXPECT_EQ(last->rssi_dbm, -60);
  EXPECT_EQ(last->free_memory_bytes, 20'000U);
  EXPECT_EQ(last->imu_calibration, 3U);
  EXPECT_NEAR(impedance_mv, 176, 0.1);
}

TEST_F(BoardTest, LatchSurvivesAResetAndLosesItsPowerWithTheBattery) {
  connect();
  order(sim_robot::emergency_stop());
  run_ms(1);
  const std::uint64_t id = board->robot().emergency_id();
  ASSERT_NE(id, 0U);
  chip.reset(4);
  boot();
  EXPECT_EQ(board->robot().emergency_id(), id);
  EXPECT_EQ(board->robot().emergency_cause(), rheonaut_EMERGENCY_CAUSE_OPERATOR);
  chip.power_cycle();
  boot();
  EXPECT_EQ(board->robot().emergency_id(), 0U);
}

TEST_F(BoardTest, ClearedLatchDoesNotComeBack) {
  connect();
  order(sim_robot::emergency_stop());
  run_ms(1);
  order(sim_robot::clear_emergency(board->robot().emergency_id()));
  run_ms(20);
  ASSERT_EQ(board->robot().emergency_id(), 0U);
  chip.reset(4);
  boot();
  EXPECT_EQ(board->robot().emergency_id(), 0U);
}

TEST_F(BoardTest, WatchdogCrashAndBrownOutComeUpLatched) {
  chip.power_cycle();
  boot();
  EXPECT_EQ(board->robot().emergency_id(), 0U) << "an ordinary power-on";
  for (const std::uint32_t reason : {1U, 2U, 3U}) {
    chip.power_cycle();
    chip.reset(reason);
    boot();
    EXPECT_EQ(board->robot().emergency_cause(), rheonaut_EMERGENCY_CAUSE_RESET) << reason;
  }
  chip.power_cycle();
  boot();
  chip.reset(0);  // power came back before the memory was gone
  boot();
  EXPECT_EQ(board->robot().emergency_cause(), rheonaut_EMERGENCY_CAUSE_RESET);
}

TEST_F(BoardTest, BootIdsDiffer) {
  connect();
  const std::uint64_t first = boot_id();
  EXPECT_NE(first, 0U);
  chip.reset(4);
  connect();
  EXPECT_NE(boot_id(), 0U);
  EXPECT_NE(boot_id(), first);
}

TEST_F(BoardTest, ParametersAreWrittenWithTheMotorOffAndKept) {
  connect();
  drive(0.5F);
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_parameter_tag;
  std::snprintf(command.action.set_parameter.name, sizeof(command.action.set_parameter.name), "setpoint_limit_m");
  command.action.set_parameter.value = 2.5F;
  chip.before_blocking = [this] { EXPECT_TRUE(board->motor().is_off()); };
  order(command);
  run_ms(300);
  EXPECT_EQ(chip.flash_erases, 0) << "the motor is on";
  run_ms(600);
  EXPECT_EQ(chip.flash_erases, 1);
  chip.reset(4);
  connect();
  wait_for_sensors();
  order(sim_robot::set_auto(2.0F));
  run_ms(20);
  EXPECT_EQ(board->robot().mode(), rheonaut_MODE_AUTO) << "beyond the default limit of 1 m";
}

TEST_F(BoardTest, LedShowsTheState) {
  boot();
  EXPECT_EQ(board->led_pattern(), LedPattern::connecting);
  come_up();
  EXPECT_EQ(board->led_pattern(), LedPattern::connected);
  received();
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  chip.reset(4);
  boot();
  for (int i = 0; i < 100 && board->link().state() != StationLink::State::open; ++i) run_ms(100);
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  frame.body.welcome.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  say(frame);
  run_ms(1);
  EXPECT_EQ(board->led_pattern(), LedPattern::refused);
}

TEST_F(BoardTest, StopThatWaitedInAStallIsReadBeforeTheLinkIsGivenUp) {
  connect();
  drive(0.5F);
  chip.pass(3'000'000);
  order(sim_robot::emergency_stop());
  const std::deque<std::uint8_t> stop = chip.socket.incoming;
  chip.socket.incoming.resize(stop.size() / 2);  // its other half is still on the way
  board->step();
  EXPECT_EQ(board->link().state(), StationLink::State::open);
  chip.socket.incoming.assign(stop.begin() + static_cast<long>(stop.size() / 2), stop.end());
  board->step();
  EXPECT_NE(board->robot().emergency_id(), 0U);
}

// The memory table of docs/robot.md: a frame of 1.0 kB, the flash record of 0.5 kB, the rest 0.4 kB.
TEST_F(BoardTest, AddsAsMuchMemoryToTheCoreAsTheTableSays) {
  EXPECT_LE(sizeof(Board) - sizeof(Robot) - sizeof(StationLink), 1'900U);
}

TEST_F(BoardTest, ComesUpWithTheControllerForItsMotor) {
  const auto built_in_with = [this](std::int8_t direction_pin) {
    Settings settings;
    settings.motor.direction_pin = direction_pin;
    chip.reset(4);
    connect(settings);
    std::uint32_t controller_id = 0;
    for (const protocol::RobotFrame& frame : received()) {
      if (frame.which_body == rheonaut_RobotFrame_hello_tag) controller_id = frame.body.hello.controller_id;
    }
    return controller_id;
  };
  EXPECT_EQ(built_in_with(kNoPin), kOneWayController.controller_id);
  EXPECT_EQ(built_in_with(13), kPaperController.controller_id);
}

TEST_F(BoardTest, DirectionPinAllowsNegativeDuties) {
  Settings settings;
  settings.motor.direction_pin = 13;
  connect(settings);
  drive(-0.5F);
  EXPECT_TRUE(chip.level(13));
  chip.reset(4);
  connect();
  order(sim_robot::set_duty(-0.5F, 500));
  run_ms(30);
  EXPECT_EQ(board->robot().duty(), 0) << "without one";
}

TEST_F(BoardTest, AHighLineOfTheMotorsSupplyStopsTheRobotWhetherItIsCutOrBroken) {
  Settings settings;
  settings.motor_supply.sense_pin = 12;
  connect(settings);
  drive(0.5F);
  EXPECT_GT(motor_high_us([this] { run_ms(20); }), 0U);
  chip.pins[12].driven_high = true;
  run_ms(11);
  EXPECT_EQ(board->robot().emergency_cause(), rheonaut_EMERGENCY_CAUSE_MOTOR_SUPPLY_CUT);
  chip.pins[12].driven_high = false;
  EXPECT_EQ(motor_high_us([this] { run_ms(500); }), 0U) << "the supply alone starts nothing";
}

TEST_F(BoardTest, WithoutALineOfTheMotorsSupplyNoPinIsRead) {
  chip.pins[12].driven_high = true;
  connect();
  drive(0.5F);
  EXPECT_GT(motor_high_us([this] { run_ms(20); }), 0U);
}

}  // namespace
}  // namespace robot_fw::esp8266
