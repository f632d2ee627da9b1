// Limits of position, of time at power, of the duty's slope, and the reference profile, on the whole robot.
#include <cmath>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

class Limits : public DrivenRobot {
 protected:
  void set(const char* name, float value) { EXPECT_EQ(answer(set_parameter(name, value)), "accepted") << name; }
  std::string cause() const { return protocol::text(station.events.back().emergency_cause); }
  // Drives at a duty, with its lease renewed, until something stops it or the ticks are over.
  void drive(float duty, int ticks) {
    order(set_duty(duty));
    for (int i = 1; i < ticks && mode() == "manual"; ++i) {
      if (i % 20 == 0) station.send(renew_lease());
      station.step();
    }
  }
  void leave_by(float limit_m) {
    set(limit_m > 0 ? "position_limit_max_m" : "position_limit_min_m", limit_m);
    drive(limit_m > 0 ? 0.5F : -0.5F, 1000);
    ASSERT_EQ(mode(), "emergency");
    ASSERT_GT(std::fabs(last().position_m), std::fabs(limit_m));
  }
  void clear() { EXPECT_EQ(answer(clear_emergency(core().emergency_id())), "accepted"); }
};

TEST_F(Limits, LeavingThePositionLimitsIsAnEmergencyInTheSameTick) {
  leave_by(0.05F);
  EXPECT_EQ(cause(), "position_limit");
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LIMIT_HIT), 1);
  for (const auto& [seq, sample] : station.samples) {
    if (sample.position_m > 0.05F) {
      EXPECT_EQ(sample.duty, 0);
      EXPECT_NE(sample.flags & rheonaut_TELEMETRY_FLAG_POSITION_LIMIT, 0u);
    } else {
      EXPECT_EQ(sample.flags & rheonaut_TELEMETRY_FLAG_POSITION_LIMIT, 0u);
    }
  }
}

TEST_F(Limits, AfterAClearOutsideOnlyInwardMotionIsAccepted) {
  leave_by(0.05F);
  clear();
  EXPECT_EQ(answer(set_duty(0.1F)), "outward");
  EXPECT_EQ(answer(set_auto(0.06F)), "outward");
  protocol::Command schedule = rheonaut_Command_init_zero;
  schedule.which_action = rheonaut_Command_set_duty_schedule_tag;
  auto& order_out = schedule.action.set_duty_schedule;
  order_out.tick_count = order_out.duty_count = 3;
  for (pb_size_t i = 0; i < 3; ++i) order_out.tick[i] = i * 5;
  order_out.duty[0] = -0.1F;
  order_out.duty[1] = 0.1F;
  EXPECT_EQ(answer(schedule), "outward");
  EXPECT_EQ(answer(set_duty(0)), "accepted");
  EXPECT_EQ(answer(set_auto(0.04F)), "accepted");
  EXPECT_EQ(answer(set_setpoint(0.06F)), "outward");
  order(set_manual());
  EXPECT_EQ(answer(set_duty(-0.3F)), "accepted");
}

TEST_F(Limits, HoldOnTheNegativeSideToo) {
  leave_by(-0.05F);
  clear();
  EXPECT_EQ(answer(set_duty(-0.1F)), "outward");
  EXPECT_EQ(answer(set_auto(-0.06F)), "outward");
  EXPECT_EQ(answer(set_duty(0.1F)), "accepted");
}

TEST_F(Limits, AfterZeroPositionOutsideADutyIsAcceptedWithinTheSameTick) {
  leave_by(0.05F);
  clear();
  const auto refused = station.send(set_duty(0.1F));
  station.send(zero_position());
  const auto accepted = station.send(set_duty(0.1F));
  station.step();
  EXPECT_EQ(result(*station.ack_of(refused)), "outward");
  EXPECT_EQ(result(*station.ack_of(accepted)), "accepted");
  EXPECT_EQ(core().duty(), 0.1F);
}

TEST_F(Limits, BackInsideTheyWatchAgain) {
  leave_by(0.05F);
  clear();
  order(set_auto(0));
  station.run(300);
  ASSERT_LT(last().position_m, 0.05F);
  EXPECT_EQ(last().flags & rheonaut_TELEMETRY_FLAG_POSITION_LIMIT, 0u);
  EXPECT_EQ(mode(), "auto");
  order(set_manual());
  drive(0.5F, 1000);
  EXPECT_EQ(cause(), "position_limit");
}

// The controller brakes with an outward duty before the robot is inside again: it gets 0 instead.
TEST_F(Limits, TheControllerGetsNoOutwardDutyOutside) {
  leave_by(0.05F);
  clear();
  order(set_auto(0.049F));
  station.run(500);
  int outside = 0;
  for (const auto& [seq, sample] : station.samples) {
    if (sample.position_m <= 0.05F || sample.mode != rheonaut_MODE_AUTO) continue;
    ASSERT_LE(sample.duty, 0) << seq;
    ++outside;
  }
  EXPECT_GT(outside, 0);
}

TEST_F(Limits, NoSetpointLiesBeyondThem) {
  set("position_limit_max_m", 0.05F);
  EXPECT_EQ(answer(set_auto(0.06F)), "out_of_range");
  EXPECT_EQ(answer(set_auto(0.05F)), "accepted");
}

TEST_F(Limits, ADisturbanceIsNotAPosition) {
  set("position_limit_max_m", 0.05F);
  order(set_auto(0));
  order(inject_disturbance(0.2F));
  station.run(5);
  EXPECT_EQ(mode(), "auto");
}

TEST_F(Limits, AnEmergencyOfAnotherCauseStaysThatWhenTheRobotCoastsOut) {
  set("position_limit_max_m", 0.05F);
  order(set_duty(1));
  while (last().position_m < 0.0499F) {
    station.send(renew_lease());
    station.step();
  }
  order(emergency_stop());
  const auto id = core().emergency_id();
  station.run(50);
  ASSERT_GT(last().position_m, 0.05F);
  EXPECT_EQ(core().emergency_id(), id);
  EXPECT_EQ(cause(), "operator");
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LIMIT_HIT), 1);
}

TEST_F(Limits, TimeAtPowerIsAnEmergency) {
  set("power_limit_duty", 0.6F);
  set("power_limit_s", 1);
  drive(0.6F, 300);
  EXPECT_EQ(mode(), "manual") << "at the limit is not above it";
  drive(-0.7F, 99);
  EXPECT_EQ(mode(), "manual");
  drive(-0.7F, 5);
  EXPECT_EQ(mode(), "emergency");
  EXPECT_EQ(cause(), "time_at_power");
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Limits, APauseGivesBackAsMuchTimeAtPowerAsItLasts) {
  set("power_limit_s", 1);
  drive(1, 80);
  drive(0.1F, 40);
  drive(1, 50);
  EXPECT_EQ(mode(), "manual");
  drive(1, 30);
  EXPECT_EQ(mode(), "emergency");
  clear();
  drive(1, 20);
  EXPECT_EQ(mode(), "emergency") << "a clear cools nothing";
}

TEST_F(Limits, TheDutyChangesNoFasterThanItsSlew) {
  set("duty_slew_per_s", 2);
  order(set_auto(0.1F));
  station.run(400);
  float before = 0;
  for (const auto& [seq, sample] : station.samples) {
    ASSERT_LE(std::fabs(sample.duty - before), 0.02F + 1e-6F) << seq;
    before = sample.duty;
  }
  EXPECT_NEAR(last().position_m, 0.1F, 2e-3F);
}

TEST_F(Limits, TheSlewDelaysNoStop) {
  set("duty_slew_per_s", 2);
  for (const auto& stop : {set_manual(), emergency_stop()}) {
    order(set_auto(0.5F));
    station.run(50);
    ASSERT_GT(core().duty(), 0.9F);
    station.send(stop);
    EXPECT_EQ(core().duty(), 0);
    station.step();
    EXPECT_EQ(core().duty(), 0);
  }
  clear();
  drive(1, 40);
  ASSERT_GT(core().duty(), 0.7F);
  order(set_duty(0));
  EXPECT_EQ(core().duty(), 0);
  order(set_duty(1));
  station.run(60);  // the lease lapses
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Limits, TheReferenceFollowsItsProfileFromTheMeasuredPosition) {
  set("profile_velocity_m_s", 0.05F);
  set("profile_acceleration_m_s2", 0.1F);
  order(set_auto(0.1F));
  EXPECT_EQ(last().reference_m, 0);
  EXPECT_EQ(last().setpoint_m, 0.1F);
  station.run(100);
  order(set_setpoint(-0.1F));
  EXPECT_EQ(last().reference_m, last().position_m);
  station.run(600);
  EXPECT_EQ(last().reference_m, -0.1F);
  EXPECT_NEAR(last().position_m, -0.1F, 1e-3F);
}

TEST_F(Limits, TimeAtPowerCountsTicksThatWereMissed) {
  set("power_limit_s", 2);
  order(set_duty(1));
  int ticks = 0;
  for (; mode() == "manual" && ticks < 400; ticks += 4) {
    station.send(renew_lease());
    station.step();
    robot.skip(3);
  }
  EXPECT_EQ(cause(), "time_at_power");
  EXPECT_NEAR(ticks, 200, 8);
}

TEST_F(Limits, AtTheVeryLimitARobotDoesNotGoToAndFro) {
  Safety safety{{}, 1};
  const PositionLimits limits{-1, 0.1F};
  EXPECT_TRUE(safety.leaves_limits(0.100001F, limits));
  for (int i = 0; i < 50; ++i) {
    EXPECT_FALSE(safety.leaves_limits(0.099999F, limits));
    EXPECT_FALSE(safety.leaves_limits(0.100001F, limits));
  }
  EXPECT_TRUE(safety.outside_limits());
  EXPECT_FALSE(safety.leaves_limits(0.098F, limits));
  EXPECT_FALSE(safety.outside_limits());
  EXPECT_TRUE(safety.leaves_limits(0.101F, limits));
}

TEST_F(Limits, TheSampleOfTheEmergencyHasNoDisturbanceLeftInIt) {
  set("position_limit_max_m", 0.05F);
  order(set_auto(0.05F));
  order(inject_disturbance(-0.02F));  // believes to be farther back than it is, and drives on over the limit
  station.run(200);
  ASSERT_EQ(mode(), "emergency");
  for (const auto& [seq, sample] : station.samples) {
    if (sample.emergency_id == 0) continue;
    EXPECT_EQ(sample.disturbance_m, 0);
    EXPECT_GT(sample.position_m, 0.05F);
    break;
  }
}

}  // namespace
}  // namespace robot_fw
