// What settings keep over a reset, and what becomes of what was kept and cannot be used; without a robot.
#include "robot_fw/core/robot_settings.hpp"

#include <gtest/gtest.h>

#include "robot_fw/core/controller_message.hpp"
#include "tests/robot_fw/memory_storage.hpp"

namespace robot_fw {
namespace {

constexpr DutyRange kBothWays{-1, 1};
constexpr std::uint32_t kPeriodUs = 10'000;
constexpr auto kAutoLimit = static_cast<std::size_t>(ParameterId::auto_limit_s);

// The built-in controller with another number.
protocol::Controller controller(std::uint32_t id) {
  ControllerSections sections = built_in_controller(kBothWays.min);
  sections.controller_id = id;
  protocol::Controller message = rheonaut_Controller_init_zero;
  write_controller(adapted(sections, kBothWays, kPeriodUs), kPeriodUs, message);
  message.checksum = checksum_of(message);
  return message;
}

class RobotSettingsTest : public ::testing::Test {
 protected:
  std::uint32_t in_force() const { return settings.controllers().in_force().controller_id; }

  MemoryStorage storage;
  RobotSettings settings{kBothWays, kPeriodUs};
};

TEST_F(RobotSettingsTest, KeepsParametersAndControllerOverAReset) {
  const float value = Parameters::spec(kAutoLimit).minimum;
  settings.set_parameter(kAutoLimit, value);
  ASSERT_TRUE(settings.set_controller(controller(7), false, 1).accepted());
  ASSERT_TRUE(settings.take_controller_news());
  const auto faults = settings.save(storage);
  EXPECT_FALSE(faults.parameters || faults.controller);

  RobotSettings next{kBothWays, kPeriodUs};
  const auto lost = next.load(storage);
  EXPECT_FALSE(lost.parameters || lost.controller);
  EXPECT_EQ(next.parameters()[ParameterId::auto_limit_s], value);
  EXPECT_EQ(next.controllers().in_force().controller_id, 7U);
  EXPECT_FALSE(next.take_controller_news()) << "what was kept is no news";
}

// SAFETY: after a reset the robot may swim in another fluid.
TEST_F(RobotSettingsTest, DoesNotKeepTheConfirmationOfTheModel) {
  settings.set_parameter(static_cast<std::size_t>(ParameterId::model_confirmed), 1);
  settings.save(storage);
  RobotSettings next{kBothWays, kPeriodUs};
  next.load(storage);
  EXPECT_EQ(next.parameters()[ParameterId::model_confirmed], 0);
}

TEST_F(RobotSettingsTest, WritesEachChangeOnce) {
  settings.save(storage);
  EXPECT_EQ(storage.saves, 0);
  settings.set_parameter(kAutoLimit, 60);
  settings.save(storage);
  settings.save(storage);
  EXPECT_EQ(storage.saves, 1);
}

TEST_F(RobotSettingsTest, AWriteThatFailsIsAFaultAndNotTriedAgain) {
  storage.is_full = true;
  settings.set_parameter(kAutoLimit, 60);
  const auto faults = settings.save(storage);
  EXPECT_TRUE(faults.parameters);
  EXPECT_FALSE(faults.controller);
  EXPECT_FALSE(settings.save(storage).parameters);
  EXPECT_EQ(storage.saves, 1);
}

TEST_F(RobotSettingsTest, DamageIsAFaultAndTheDefaultsStay) {
  storage.values[StorageKey::parameters] = {1, 2, 3};
  EXPECT_TRUE(settings.load(storage).parameters);
  EXPECT_EQ(settings.parameters().checksum(), Parameters{}.checksum());
}

// SAFETY: what was kept is judged like what comes over the link.
TEST_F(RobotSettingsTest, AControllerForAnotherMotorIsAFaultAndTheBuiltInOneStays) {
  ASSERT_TRUE(settings.set_controller(controller(7), false, 1).accepted());
  settings.take_controller_news();
  settings.save(storage);
  RobotSettings forwards{{0, 1}, kPeriodUs};
  const auto built_in = forwards.controllers().in_force().controller_id;
  EXPECT_TRUE(forwards.load(storage).controller);
  EXPECT_EQ(forwards.controllers().in_force().controller_id, built_in);
}

TEST_F(RobotSettingsTest, RefusesAControllerThatTheMotorCannotFollow) {
  auto bad = controller(7);
  bad.checksum += 1;
  EXPECT_FALSE(settings.set_controller(bad, false, 1).accepted());
  EXPECT_NE(in_force(), 7U);
  EXPECT_FALSE(settings.take_controller_news());
}

TEST_F(RobotSettingsTest, SaysByWhichCommandTheControllerCame) {
  const std::uint32_t built_in = in_force();
  EXPECT_FALSE(settings.restore_controller(false, 1).accepted()) << "there is none before it";
  ASSERT_TRUE(settings.set_controller(controller(7), false, 2).accepted());
  EXPECT_EQ(settings.controller_command_id(), 2U);
  ASSERT_TRUE(settings.restore_controller(false, 3).accepted());
  EXPECT_EQ(settings.controller_command_id(), 3U);
  EXPECT_EQ(in_force(), built_in);
}

}  // namespace
}  // namespace robot_fw
