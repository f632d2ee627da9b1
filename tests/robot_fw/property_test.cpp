// Whatever arrives, in whatever order: the duty stays in range, an emergency stays at 0, and nothing crashes.
#include <iterator>
#include <limits>
#include <random>
#include <vector>

#include "tests/robot_fw/bare_core.hpp"
#include "tests/robot_fw/controllers.hpp"
#include "tests/robot_fw/driven_robot.hpp"
#include "tests/robot_fw/memory_storage.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

// Commands as a confused or hostile station might make them.
class RandomStation {
 public:
  RandomStation(unsigned seed, const Robot& core) : random_(seed), core_(core) {}

  protocol::Command command(std::uint64_t now_us) {
    protocol::Command command = action();
    command.command_id = pick({number(), number(), 1 + number() % 50, 0});
    command.boot_id = pick({kBootId, kBootId, kBootId, kBootId, kBootId, 0, number()});
    command.valid_until_robot_us =
        pick({now_us + 1'000'000, now_us + 1'000'000, now_us + 1'000'000, now_us - std::min<std::uint64_t>(now_us, 1),
              now_us + 20'000'000, UINT64_MAX, 0});
    command.has_execute_at_robot_us = number() % 4 == 0;
    command.execute_at_robot_us = now_us + number() % 1'000'000;
    return command;
  }
  unsigned ticks() { return 1 + number() % 30; }
  unsigned number() { return static_cast<unsigned>(random_()); }

 private:
  std::uint64_t pick(std::vector<std::uint64_t> from) { return from[number() % from.size()]; }
  float value() {
    const float values[] = {0,
                            0.1F,
                            -0.1F,
                            0.5F,
                            -1,
                            1,
                            1.5F,
                            -7,
                            1e30F,
                            std::numeric_limits<float>::infinity(),
                            std::numeric_limits<float>::quiet_NaN()};
    return values[number() % std::size(values)];
  }
  protocol::Command action() {
    switch (number() % 16) {
      case 0: return emergency_stop();
      case 1: return set_manual();
      case 2:
      case 3: return set_auto(value());
      case 4: return set_setpoint(value());
      case 5:
      case 6: return set_duty(value(), number() % 600);
      case 7: return renew_lease();
      case 8: return inject_disturbance(value());
      case 9: return zero_position();
      case 10: return set_controller(controller());
      case 11: return restore_controller();
      case 12: {
        const ParameterSpec& spec = Parameters::spec(number() % kParameterCount);
        return set_parameter(spec.name,
                             number() % 4 == 0 ? value() : spec.minimum + 0.1F * (spec.maximum - spec.minimum));
      }
      case 13: return get_parameters(number() % (kParameterCount + 1));
      case 14: return clear_emergency(number() % 8 == 0 ? number() : core_.emergency_id());
      default: return schedule();
    }
  }
  // Sound ones, ones with a wrong value and the right checksum, and ones with a wrong checksum.
  protocol::Controller controller() {
    protocol::Controller controller = number() % 2 == 0 ? biquad_controller() : scaled_controller(3, 1.5F);
    controller.duty_min = number() % 2 == 0 ? 0 : -0.4F;
    if (number() % 2 == 0) controller.duty_max = 0.5F;
    controller.derivative_on = number() % 2 == 0 ? rheonaut_DERIVATIVE_ON_ERROR : rheonaut_DERIVATIVE_ON_MEASUREMENT;
    float* numbers[] = {&controller.kp,           &controller.direct,       &controller.pole[0],
                        &controller.residue[0],   &controller.biquad_b0[0], &controller.biquad_a1[0],
                        &controller.biquad_a2[0], &controller.duty_max};
    if (number() % 2 == 0) *numbers[number() % std::size(numbers)] = value();
    return number() % 8 == 0 ? controller : with_checksum(controller);
  }
  protocol::Command schedule() {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_schedule_tag;
    auto& order = command.action.set_duty_schedule;
    order.tick_count = order.duty_count = static_cast<pb_size_t>(number() % 65);
    for (pb_size_t i = 0; i < order.tick_count; ++i) {
      order.tick[i] = number() % 8 == 0 ? number() : i;
      order.duty[i] = number() % 16 == 0 ? value() : 0.3F;
    }
    if (order.duty_count > 0) order.duty[order.duty_count - 1] = 0;
    return command;
  }

  std::mt19937 random_;
  const Robot& core_;
};

// Sensors that fail in every way, and recover.
void turn_sensors(BareCore& core, RandomStation& random) {
  const auto one_in = [&](unsigned n) { return random.number() % n == 0; };
  core.accelerometer_answers = !one_in(6);
  core.steady_counts.reset();
  if (one_in(6)) core.steady_counts = static_cast<std::int16_t>(random.number());
  core.mean_counts = one_in(4) ? static_cast<int>(random.number() % 8001) - 4000 : 0;
  core.swing_counts = 1 + static_cast<int>(random.number() % 20);
  core.known_position_m.reset();
  if (one_in(5)) core.known_position_m = static_cast<float>(random.number() % 2001) * 1e-3F - 1;
  const float impedances_mv[] = {175, 175, 175, 165, 120, 120, 0, 1500};
  core.impedance_mv = impedances_mv[random.number() % std::size(impedances_mv)];
  core.supply_mv = one_in(40) ? std::numeric_limits<float>::quiet_NaN() : 3000;
}

// An answer that nothing was done must be true; that the station lives is all that the robot has learnt.
void expect_refusal_to_change_nothing(const BareCore& before, const BareCore& after) {
  BareCore with = after, without = before;
  without.heartbeat();
  for (BareCore* each : {&with, &without}) each->run(2);
  ASSERT_EQ(with.robot.float_state_checksum(), without.robot.float_state_checksum());
  ASSERT_EQ(with.robot.mode(), without.robot.mode());
  ASSERT_EQ(with.robot.emergency_id(), without.robot.emergency_id());
  ASSERT_EQ(with.sample.sub_state, without.sample.sub_state);
  ASSERT_EQ(with.sample.setpoint_m, without.sample.setpoint_m);
  ASSERT_EQ(with.sample.disturbance_m, without.sample.disturbance_m);
  ASSERT_EQ(with.sample.flags, without.sample.flags);
  const auto with_hello = with.hello_now(), without_hello = without.hello_now();
  ASSERT_EQ(with_hello.parameters_checksum, without_hello.parameters_checksum);
  ASSERT_EQ(with_hello.controller_checksum, without_hello.controller_checksum);
}

class AnyOrder : public ::testing::TestWithParam<unsigned> {};

TEST_P(AnyOrder, TheDutyStaysInRangeAndIsZeroInEmergency) {
  SimulatedRobotConfig config;
  config.boot_id = kBootId;
  if (GetParam() % 2 == 0) config.duty = {0, 0.6F};
  MemoryStorage storage;
  config.storage = &storage;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  RandomStation random{GetParam(), robot.core()};
  station.connect();
  for (int round = 0; round < 400; ++round) {
    station.send(random.command(robot.robot_time_us()));
    if (robot.core().mode() == rheonaut_MODE_EMERGENCY) ASSERT_EQ(robot.core().duty(), 0);
    if (round % 50 == 49) {  // a cut, sometimes longer than the time-out
      station.disconnect();
      station.run(static_cast<int>(random.number() % 200));
      station.connect();
    }
    station.run(static_cast<int>(random.ticks()));
  }
  station.run(500);
  for (const auto& [seq, sample] : station.samples) {
    ASSERT_GE(sample.duty, config.duty.min) << seq;
    ASSERT_LE(sample.duty, config.duty.max) << seq;
    if (sample.mode == rheonaut_MODE_EMERGENCY) ASSERT_EQ(sample.duty, 0) << seq;
    ASSERT_EQ(sample.setpoint_m.has_value(), sample.mode == rheonaut_MODE_AUTO) << seq;
    ASSERT_EQ(sample.emergency_id != 0, sample.mode == rheonaut_MODE_EMERGENCY) << seq;
  }
  EXPECT_EQ(station.samples.size(), station.samples.rbegin()->first + 1);  // and not one is missing
}

// Two robots receive the same; one also receives late or repeated commands. They behave identically.
TEST_P(AnyOrder, ExpiredAndRepeatedCommandsChangeNothing) {
  SimulatedRobotConfig config;
  config.boot_id = kBootId;
  SimulatedRobot plain{config}, pestered{config};
  StationPeer station{plain}, pest{pestered};
  RandomStation random{GetParam(), plain.core()};
  station.connect();
  pest.connect();
  std::vector<protocol::Command> said;
  for (int round = 0; round < 200; ++round) {
    protocol::Command command = random.command(plain.robot_time_us());
    if (command.which_action == rheonaut_Command_emergency_stop_tag) command = ping();
    command.command_id = 1'000'000 + static_cast<std::uint64_t>(round);
    station.send(command);
    pest.send(command);
    said.push_back(command);
    pest.send(said[said.size() - 1 - random.number() % std::min<std::size_t>(said.size(), 20)]);
    protocol::Command late = random.command(plain.robot_time_us());
    if (late.which_action != rheonaut_Command_emergency_stop_tag && pestered.robot_time_us() > 0) {
      late.command_id = 0;
      late.boot_id = kBootId;
      late.valid_until_robot_us = pestered.robot_time_us() - 1;
      late.command_id = 2'000'000 + static_cast<std::uint64_t>(round);
      if (round % 4 == 0) pest.send(late);
    }
    const auto ticks = static_cast<int>(random.ticks());
    station.run(ticks);
    pest.run(ticks);
    ASSERT_EQ(plain.core().duty(), pestered.core().duty()) << "round " << round;
    ASSERT_EQ(plain.core().mode(), pestered.core().mode()) << "round " << round;
    const auto &said_by_plain = station.controllers, &said_by_pestered = pest.controllers;
    ASSERT_EQ(said_by_plain.size(), said_by_pestered.size()) << "round " << round;
    ASSERT_EQ(plain.world().position_m(), pestered.world().position_m()) << "round " << round;
  }
  for (StationPeer* each : {&station, &pest}) {
    each->disconnect();
    each->connect();
  }
  EXPECT_EQ(station.hello->parameters_checksum, pest.hello->parameters_checksum);
  EXPECT_EQ(station.hello->controller_checksum, pest.hello->controller_checksum);
}

// BareCore holds the invariants in every tick and after every command. Some commands arrive late and in another order.
TEST_P(AnyOrder, SensorsAndLinksThatFailLeaveTheInvariants) {
  RobotConfig config = BareCore::config();
  if (GetParam() % 2 == 0) config.duty_min = 0, config.duty_max = 0.6F;
  BareCore core{config};
  core.tick();
  core.renews = false;
  core.order(set_parameter("link_loss_action", static_cast<float>(GetParam() % 3)));
  RandomStation random{GetParam(), core.robot};
  std::vector<protocol::Command> on_the_way;
  for (int round = 0; round < 150 && !HasFatalFailure(); ++round) {
    on_the_way.push_back(random.command(core.now_us));
    while (on_the_way.size() > random.number() % 6) {
      const auto next = on_the_way.begin() + random.number() % static_cast<unsigned>(on_the_way.size());
      const BareCore before = core;
      const auto result = core.order(*next).result;
      const bool is_stop = next->which_action == rheonaut_Command_emergency_stop_tag;
      on_the_way.erase(next);
      if (result != rheonaut_COMMAND_RESULT_ACCEPTED && !is_stop) expect_refusal_to_change_nothing(before, core);
    }
    if (random.number() % 4 == 0) turn_sensors(core, random);
    core.attentive = random.number() % 5 != 0;
    for (unsigned ticks = random.ticks(); ticks > 0; --ticks) {
      core.tick();
      if ((core.sample.flags & rheonaut_TELEMETRY_FLAG_POSITION_LIMIT) == 0) continue;
      const float position_m = core.sample.position_m[0] - core.sample.disturbance_m;
      ASSERT_LE(core.robot.duty() * position_m, 0) << "outside, only inward; the limits have 0 between them";
    }
  }
}

TEST_P(AnyOrder, RandomBytesNeitherCrashNorMoveTheRobot) {
  SimulatedRobotConfig config;
  config.boot_id = kBootId;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  std::mt19937 random{GetParam()};
  for (int round = 0; round < 300; ++round) {
    station.connect();
    std::vector<std::uint8_t> noise(random() % 2000);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    if (noise.size() > 60) {  // a plausible start: a frame with a command in it
      noise[0] = static_cast<std::uint8_t>(random() % 60);
      noise[1] = 0x1A;
      noise[2] = static_cast<std::uint8_t>(noise[0] - 2);
    }
    robot.receive({noise.data(), noise.size()}, robot.robot_time_us());
    station.step();
    ASSERT_EQ(robot.core().duty(), 0);
    station.disconnect();
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, AnyOrder, ::testing::Range(1U, 13U));

}  // namespace
}  // namespace robot_fw
