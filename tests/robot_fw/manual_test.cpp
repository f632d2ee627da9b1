// A manual duty and a schedule live only as long as somebody renews their lease; auto ends by itself.
#include <cmath>
#include <initializer_list>
#include <utility>
#include <vector>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;
using Manual = DrivenRobot;

protocol::Command schedule(std::initializer_list<std::pair<unsigned, float>> entries) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_duty_schedule_tag;
  auto& order = command.action.set_duty_schedule;
  for (const auto& [tick, duty] : entries) {
    order.tick[order.tick_count++] = tick;
    order.duty[order.duty_count++] = duty;
  }
  return command;
}

TEST_F(Manual, ADutyLivesHalfASecond) {
  order(set_duty(0.5F));
  EXPECT_EQ(core().duty(), 0.5F);
  station.run(49);
  EXPECT_EQ(core().duty(), 0.5F);
  station.step();
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LEASE_LAPSED), 1);
  EXPECT_EQ(station.events.back().value, 0.5F);
  EXPECT_NE(last().flags & rheonaut_TELEMETRY_FLAG_LEASE_LAPSED, 0u);
}

TEST_F(Manual, ADutyLivesOnWhileItIsRenewed) {
  order(set_duty(0.5F));
  for (int i = 0; i < 10; ++i) {
    station.run(30);
    EXPECT_EQ(answer(renew_lease()), "accepted");
    EXPECT_EQ(core().duty(), 0.5F);
  }
}

TEST_F(Manual, AShorterLeaseIsKept) {
  order(set_duty(0.5F, 100));
  station.run(9);
  EXPECT_EQ(core().duty(), 0.5F);
  station.step();
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Manual, ALapsedLeaseCannotBeRenewed) {
  order(set_duty(0.5F));
  station.run(60);
  EXPECT_EQ(answer(renew_lease()), "nothing_to_renew");
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(answer(set_duty(0.4F)), "accepted");
  EXPECT_EQ(core().duty(), 0.4F);
}

TEST_F(Manual, ADutyOfZeroHasNothingToRenew) {
  order(set_duty(0.5F));
  order(set_duty(0));
  EXPECT_EQ(answer(renew_lease()), "nothing_to_renew");
  station.run(60);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LEASE_LAPSED), 0);
}

TEST_F(Manual, AScheduleRunsTickByTickAndEnds) {
  const auto first_seq = station.samples.size();
  EXPECT_EQ(answer(schedule({{0, 0.1F}, {3, -0.2F}, {5, 0}})), "accepted");
  station.run(9);
  const std::vector<float> expected{0.1F, 0.1F, 0.1F, -0.2F, -0.2F, 0, 0, 0, 0, 0};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(station.samples.at(first_seq + i).duty, expected[i]) << i;
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DUTY_SCHEDULE_ENDED), 1);
}

TEST_F(Manual, AScheduleEndsWithItsLease) {
  order(schedule({{0, 0.1F}, {1000, 0}}));
  station.run(60);
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LEASE_LAPSED), 1);
  station.run(1000);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DUTY_SCHEDULE_ENDED), 0);
}

TEST_F(Manual, ADutyReplacesTheSchedule) {
  order(schedule({{0, 0.1F}, {20, 0.3F}, {30, 0}}));
  order(set_duty(0.2F));
  station.run(25);
  EXPECT_EQ(core().duty(), 0.2F);
}

TEST_F(Manual, SchedulesMustAscendStayInRangeAndEndAtZero) {
  EXPECT_EQ(answer(schedule({})), "malformed");
  EXPECT_EQ(answer(schedule({{0, 0.1F}})), "malformed");
  EXPECT_EQ(answer(schedule({{5, 0.1F}, {5, 0}})), "malformed");
  EXPECT_EQ(answer(schedule({{0, 1.5F}, {5, 0}})), "out_of_range");
  EXPECT_EQ(answer(schedule({{0, std::nanf("")}, {5, 0}})), "not_finite");
  protocol::Command uneven = schedule({{0, 0.1F}, {5, 0}});
  uneven.action.set_duty_schedule.tick_count = 1;
  EXPECT_EQ(answer(uneven), "malformed");
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Manual, AutoEndsByItselfAfterTenMinutes) {
  order(set_auto(0.1F));
  station.run(60'000 - 1);
  EXPECT_EQ(mode(), "auto");
  station.step();
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_AUTO_LIMIT), 1);
  expect_at_rest();
}

}  // namespace
}  // namespace robot_fw
