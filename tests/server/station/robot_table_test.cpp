// Entries of robots, whose connection counts, and how often the same event is published.
#include "server/station/robot_table.hpp"

#include "tests/server/station/entry_fixture.hpp"

namespace server {
namespace {

TEST(RobotTableTest, ARobotIsAddedOnceAndFoundByItsBoot) {
  station::RobotTable table;
  station::RobotEntry& entry = table.add("r1");
  entry.robot.boot_id = 7;
  EXPECT_EQ(&table.add("r1"), &entry);
  EXPECT_EQ(table.find("r1"), &entry);
  EXPECT_EQ(table.find("r2"), nullptr);
  EXPECT_EQ(table.find("r1", 7), &entry);
  EXPECT_EQ(table.find("r1", 8), nullptr);
  EXPECT_EQ(&table.states().at("r1"), &entry.robot);
}

TEST(RobotTableTest, ANewerConnectionTakesThePlaceOfTheOlder) {
  station::RobotTable table;
  station::RobotEntry& entry = table.add("r1");
  KeepingLink older, newer;
  EXPECT_EQ(station::RobotTable::connect(entry, older), nullptr);
  EXPECT_EQ(station::RobotTable::of(older), &entry);
  EXPECT_EQ(station::RobotTable::connect(entry, newer), &older);
  EXPECT_EQ(station::RobotTable::of(older), nullptr);
  EXPECT_EQ(station::RobotTable::of(newer), &entry);
  station::RobotTable::disconnect(entry);
  EXPECT_EQ(station::RobotTable::of(newer), nullptr);
  EXPECT_EQ(entry.link, nullptr);
}

TEST(RobotTableTest, AnotherBootMayConnectOnlyWhenTheRobotHasBeenSilent) {
  station::RobotTable table;
  EXPECT_TRUE(table.may_connect("r1", 7, 0, 1'000)) << "not known yet";
  station::RobotEntry& entry = table.add("r1");
  KeepingLink link;
  station::RobotTable::connect(entry, link);
  entry.robot.boot_id = 7;
  entry.robot.last_received_steady_us = 5'000;
  EXPECT_TRUE(table.may_connect("r1", 7, 5'500, 1'000));
  EXPECT_EQ(table.may_connect("r1", 8, 5'500, 1'000).error().code, ErrorCode::conflict);
  EXPECT_TRUE(table.may_connect("r1", 8, 6'000, 1'000));
}

TEST(EventLimitTest, OneInAPeriodIsPublishedAndTheOthersAreCounted) {
  station::EventLimit limit{10};
  EXPECT_EQ(limit.admit(100), 0u);
  EXPECT_EQ(limit.admit(105), std::nullopt);
  EXPECT_EQ(limit.admit(109, 3), std::nullopt);
  EXPECT_EQ(limit.admit(110), 4u);
  EXPECT_EQ(limit.admit(120), 0u);
}

}  // namespace
}  // namespace server
