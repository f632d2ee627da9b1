// When the effect in telemetry proves that a command has run whose answer is lost.
#include "server/station/commands/effect_proof.hpp"

#include "tests/server/station/entry_fixture.hpp"

namespace server {
namespace {

class EffectProofTest : public EntryTest {
 protected:
  std::shared_ptr<station::PendingCommand> send(const protocol::Command& command) {
    const auto pending = add(command);
    prepare_proof(robot, entry.commands, *pending, robot.latest_robot_time_us);
    pending->record.state = station::CommandState::sent;
    return pending;
  }
  static station::SampleBatch batch_with_duty(float duty, std::uint64_t from_robot_us) {
    station::SampleBatch batch;
    batch.first_robot_time_us = from_robot_us;
    batch.context.period_us = 10'000;
    batch.context.mode = rheonaut_MODE_MANUAL;
    batch.samples.resize(2);
    for (station::Sample& sample : batch.samples) sample.duty = duty;
    return batch;
  }
};

TEST_F(EffectProofTest, ADutyThatNothingElseExplainsIsAProofWhileItCanHaveTakenEffect) {
  const auto duty = send(set_duty(0.3F));
  EXPECT_TRUE(is_proved(*duty, batch_with_duty(0.3F, 1'100'000)));
  EXPECT_FALSE(is_proved(*duty, batch_with_duty(0.2F, 1'100'000)));
  EXPECT_FALSE(is_proved(*duty, batch_with_duty(0.3F, 500'000))) << "made before it was sent";
  EXPECT_FALSE(is_proved(*duty, batch_with_duty(0.3F, 9'000'000))) << "made after its time to live";
}

TEST_F(EffectProofTest, WhatTheRobotComesToByItselfProvesNothing) {
  const auto halt = send(set_duty(0));
  EXPECT_FALSE(is_proved(*halt, batch_with_duty(0, 1'100'000)));
}

TEST_F(EffectProofTest, WhatTheRobotShowedBeforeProvesNothing) {
  robot.context.mode = rheonaut_MODE_MANUAL;
  robot.context.period_us = 10'000;
  robot.sample = station::Sample{.duty = 0.3F};
  const auto duty = send(set_duty(0.3F));
  EXPECT_FALSE(is_proved(*duty, batch_with_duty(0.3F, 1'100'000)));
}

TEST_F(EffectProofTest, OfTwoCommandsForTheMotorNeitherEffectProvesTheLater) {
  const auto first = send(set_duty(0.2F));
  robot.latest_robot_time_us = 1'100'000;
  const auto second = send(set_duty(0.3F));
  EXPECT_FALSE(is_proved(*second, batch_with_duty(0.3F, 1'200'000)));
  EXPECT_TRUE(is_proved(*first, batch_with_duty(0.2F, 1'050'000)));
  EXPECT_FALSE(is_proved(*first, batch_with_duty(0.2F, 1'200'000))) << "the later one was on its way";
}

}  // namespace
}  // namespace server
