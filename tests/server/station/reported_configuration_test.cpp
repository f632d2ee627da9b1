// What a robot has reported, and the records that come of it.
#include "server/station/reported_configuration.hpp"

#include <gtest/gtest.h>

#include <cstring>

namespace server {
namespace {

protocol::ParameterPage page_of(const char* name, float value) {
  protocol::ParameterPage page = rheonaut_ParameterPage_init_zero;
  page.total = page.parameters_count = 1;
  std::strncpy(page.parameters[0].name, name, sizeof page.parameters[0].name - 1);
  page.parameters[0].value = value;
  return page;
}

station::RobotState robot_of_boot_7() {
  station::RobotState robot;
  robot.boot_id = 7;
  robot.sample_period_us = 10'000;
  robot.next_seq = 100;
  robot.latest_robot_time_us = 1'000'000;
  return robot;
}

TEST(ReportedConfigurationTest, TheFirstReportOfAConnectionIsNoChangeAndTheNextIs) {
  station::ReportedConfiguration reported;
  const auto first = reported.add(page_of("a", 1), {7, 100, 5});
  ASSERT_TRUE(first.has_value());
  EXPECT_FALSE(first->is_change);
  EXPECT_EQ(first->boot_id, 7u);
  EXPECT_EQ(first->first_seq, 100u);
  EXPECT_EQ(first->noticed_at_us, 5);
  EXPECT_FALSE(reported.add(page_of("a", 1), {7, 110, 6}).has_value());
  EXPECT_EQ(reported.settings().parameters_at_us, 5);
  const auto next = reported.add(page_of("a", 2), {7, 120, 7});
  ASSERT_TRUE(next.has_value());
  EXPECT_TRUE(next->is_change);
  EXPECT_FALSE(reported.add(protocol::Controller(rheonaut_Controller_init_zero), {}, {7, 120, 7}).is_change)
      << "of another kind";
  reported.begin_connection();
  EXPECT_FALSE(reported.settings().is_controller_current);
  EXPECT_FALSE(reported.add(page_of("a", 2), {7, 130, 8})->is_change);
}

TEST(ReportedConfigurationTest, SamplesThatAreStillOnTheirWayWereMadeBeforeTheReport) {
  const station::RobotState robot = robot_of_boot_7();
  EXPECT_EQ(moment_of_report(robot, 1'000'000, 1).first_seq, 100u);
  EXPECT_EQ(moment_of_report(robot, 975'000, 1).first_seq, 103u) << "25 ms are three periods, the last begun";
  EXPECT_EQ(moment_of_report(robot, 1'010'000, 1).first_seq, 100u);
}

TEST(ReportedConfigurationTest, TheClockIsRecordedOnceAMinuteAndWhenTheStationsTimeIsSet) {
  station::ReportedConfiguration reported;
  station::RobotState robot = robot_of_boot_7();
  std::int64_t now_us = 50'000'000;
  std::int64_t utc_minus_steady_us = 1'000'000'000;
  const auto exchange = [&](std::int64_t after_us) {
    now_us += after_us;
    robot.latest_robot_time_us += static_cast<std::uint64_t>(after_us);
    const auto at_robot_us = static_cast<std::int64_t>(robot.latest_robot_time_us);
    return reported.add({now_us - 1'000, at_robot_us - 500, at_robot_us - 500, now_us}, robot, utc_minus_steady_us);
  };
  EXPECT_TRUE(exchange(0).record.has_value()) << "the first of the boot";
  EXPECT_FALSE(exchange(1'000'000).record.has_value());
  EXPECT_TRUE(exchange(60'000'000).record.has_value());
  utc_minus_steady_us += 70'000;
  const auto set = exchange(1'000'000);
  EXPECT_EQ(set.station_step_us, 70'000);
  ASSERT_TRUE(set.record.has_value());
  EXPECT_EQ(set.record->station_step_us, 70'000);
  reported.begin_boot();
  const auto of_next_boot = exchange(1'000'000);
  EXPECT_TRUE(of_next_boot.record.has_value());
  EXPECT_EQ(of_next_boot.station_step_us, 0);
}

}  // namespace
}  // namespace server
