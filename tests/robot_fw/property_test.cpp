// Whatever arrives, in whatever order: the duty stays in range, an emergency stays at 0, and nothing crashes.
#include <iterator>
#include <limits>
#include <random>
#include <vector>

#include "tests/robot_fw/controllers.hpp"
#include "tests/robot_fw/driven_robot.hpp"
#include "tests/robot_fw/memory_storage.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

// Commands as a confused or hostile station might make them.
class RandomStation {
 public:
  RandomStation(unsigned seed, const SimulatedRobot& robot) : random_(seed), robot_(robot) {}

  protocol::Command command() {
    protocol::Command command = action();
    command.command_id = pick({number(), number(), 1 + number() % 50, 0});
    command.boot_id = pick({kBootId, kBootId, kBootId, kBootId, kBootId, 0, number()});
    const std::uint64_t now_us = robot_.robot_time_us();
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
      case 14: return clear_emergency(number() % 8 == 0 ? number() : robot_.core().emergency_id());
      default: return schedule();
    }
  }
  // Sound ones, ones with a wrong value and the right checksum, and ones with a wrong checksum.
  protocol::Controller controller() {
    protocol::Controller controller = number() % 2 == 0 ? golden_biquads() : scaled_controller(3, 1.5F);
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
  const SimulatedRobot& robot_;
};

class AnyOrder : public ::testing::TestWithParam<unsigned> {};

TEST_P(AnyOrder, TheDutyStaysInRangeAndIsZeroInEmergency) {
  SimulatedRobotConfig config;
  config.boot_id = kBootId;
  if (GetParam() % 2 == 0) config.duty = {0, 0.6F};
  MemoryStorage storage;
  config.storage = &storage;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  RandomStation random{GetParam(), robot};
  station.connect();
  for (int round = 0; round < 400; ++round) {
    station.send(random.command());
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

// Two robots hear the same; one also hears commands that are too late or came before. Nobody can tell them apart.
TEST_P(AnyOrder, ExpiredAndRepeatedCommandsChangeNothing) {
  SimulatedRobotConfig config;
  config.boot_id = kBootId;
  SimulatedRobot plain{config}, pestered{config};
  StationPeer station{plain}, pest{pestered};
  RandomStation random{GetParam(), plain};
  station.connect();
  pest.connect();
  std::vector<protocol::Command> said;
  for (int round = 0; round < 200; ++round) {
    protocol::Command command = random.command();
    if (command.which_action == rheonaut_Command_emergency_stop_tag) command = ping();
    command.command_id = 1'000'000 + static_cast<std::uint64_t>(round);
    station.send(command);
    pest.send(command);
    said.push_back(command);
    pest.send(said[said.size() - 1 - random.number() % std::min<std::size_t>(said.size(), 20)]);
    protocol::Command late = random.command();
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
