// Ticks that come late, a little or after a stall: what the core, the plant and the station see of it.
#include "sim_robot/robot/simulated_robot.hpp"

#include <gtest/gtest.h>

#include "control/search/missed_ticks.hpp"
#include "robot_fw/core/motion_sense.hpp"
#include "sim_robot/lab/station_peer.hpp"

namespace sim_robot {
namespace {

constexpr std::uint64_t kTickUs = SimulatedRobot::kPeriodUs;
constexpr std::uint64_t kStallUs = 12'000'000;

class LateTicks : public ::testing::Test {
 protected:
  LateTicks() {
    station.welcome.samples_per_frame = 1;  // every sample is heard in its tick
    station.connect();
    station.run(2);
  }
  void stall(std::uint64_t duration_us) {
    robot.advance_to(robot.robot_time_us() + duration_us);
    station.listen();
  }
  std::uint32_t missed_ticks() {
    std::uint32_t missed = 0;
    for (const auto& frame : station.frames) {
      if (frame.which_body == rheonaut_RobotFrame_status_tag) missed = frame.body.status.missed_ticks;
    }
    return missed;
  }
  bool happened(protocol::EventKind kind) const {
    for (const auto& event : station.events) {
      if (event.kind == kind) return true;
    }
    return false;
  }

  SimulatedRobot robot{{}};
  StationPeer station{robot};
};

TEST_F(LateTicks, ASmallLatenessLosesNoSample) {
  const auto before = station.samples.size();
  stall(SimulatedRobot::kMaxLatenessUs);
  EXPECT_EQ(station.samples.size(), before + 6);
  for (const auto& [seq, sample] : station.samples) EXPECT_EQ(sample.robot_time_us, seq * kTickUs);
  EXPECT_FALSE(happened(rheonaut_EVENT_KIND_TIME_STEP));
  station.run(101);
  EXPECT_EQ(missed_ticks(), 0u);
}

TEST_F(LateTicks, NoTickIsDueAfterwardsAndNoneRanEarly) {
  for (const std::uint64_t late_us : {0U, 1U, 9'999U, 10'000U, 50'000U, 50'001U, 59'999U, 60'000U, 123'456U}) {
    const std::uint64_t now_us = robot.robot_time_us() + late_us;
    robot.advance_to(now_us);
    EXPECT_GT(robot.robot_time_us(), now_us);
    EXPECT_LE(robot.robot_time_us(), now_us + kTickUs);
  }
  const std::uint64_t next_us = robot.robot_time_us();
  robot.advance_to(next_us - 1);
  EXPECT_EQ(robot.robot_time_us(), next_us);
}

TEST_F(LateTicks, AStallIsOneTickThatSeesTheTimeStep) {
  const auto before = station.samples.size();
  const std::uint64_t due_us = robot.robot_time_us();
  stall(kStallUs);
  EXPECT_EQ(station.samples.size(), before + 1);
  EXPECT_EQ(station.samples.rbegin()->second.robot_time_us, due_us + kStallUs);
  EXPECT_TRUE(happened(rheonaut_EVENT_KIND_TIME_STEP));
  EXPECT_EQ(missed_ticks(), kStallUs / kTickUs);
}

TEST_F(LateTicks, TheMotorIsOff50MsAfterTheLastTick) {
  station.send(set_duty(0.5F));
  station.step();
  robot.skip(4);
  EXPECT_EQ(robot.motor_duty(), 0.5);
  robot.skip(1);
  EXPECT_EQ(robot.motor_duty(), 0) << "from 50 ms on";
}

// The core's estimate, the simulator and the fits of records have it from the board.
TEST(MotorOff, IsAtOneTimeForAll) {
  EXPECT_FLOAT_EQ(static_cast<float>(control::kMotorOffS), robot_fw::kMotorOffS);
  EXPECT_FLOAT_EQ(5 * static_cast<float>(SimulatedRobot::kPeriodS), robot_fw::kMotorOffS);
}

TEST_F(LateTicks, TheMotorRunsOnFor40MsOfAStall) {
  SimulatedRobot short_push{{}};
  StationPeer other{short_push};
  other.connect();
  other.run(2);
  other.send(set_duty(0.5F));
  other.run(5);  // one tick, and four more of the stall
  other.send(set_duty(0));
  station.send(set_duty(0.5F));
  station.step();
  stall(39 * kTickUs);
  other.run(static_cast<int>((robot.robot_time_us() - short_push.robot_time_us()) / kTickUs));
  EXPECT_EQ(robot.robot_time_us(), short_push.robot_time_us());
  EXPECT_GT(robot.world().position_m(), 0.001);
  EXPECT_NEAR(robot.world().position_m(), short_push.world().position_m(), 0.001);
  EXPECT_EQ(robot.core().duty(), 0.5F);  // the lease runs
}

TEST_F(LateTicks, AStallEndsAuto) {
  station.send(set_auto(0.1F));
  station.step();
  ASSERT_NE(robot.core().duty(), 0);
  stall(kStallUs);
  EXPECT_EQ(robot.core().duty(), 0);
  EXPECT_EQ(robot.core().mode(), rheonaut_MODE_MANUAL);
  EXPECT_TRUE(robot.core().link_lost());
  EXPECT_TRUE(happened(rheonaut_EVENT_KIND_LINK_LOST));
}

TEST_F(LateTicks, AStallEndsALease) {
  station.send(set_duty(0.5F));
  station.step();
  stall(600'000);  // shorter than the link's time-out
  EXPECT_EQ(robot.core().duty(), 0);
  EXPECT_TRUE(happened(rheonaut_EVENT_KIND_LEASE_LAPSED));
}

TEST_F(LateTicks, CommandsOfBeforeAStallExpire) {
  protocol::Command command = set_auto(0.1F);
  command.valid_until_robot_us = robot.robot_time_us() + 2'000'000;
  stall(kStallUs);
  const auto id = station.send(command);
  station.run(2);
  EXPECT_EQ(station.ack_of(id)->result, rheonaut_COMMAND_RESULT_EXPIRED);
  EXPECT_EQ(robot.core().duty(), 0);
}

}  // namespace
}  // namespace sim_robot
