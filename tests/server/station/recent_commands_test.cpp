// The memory of keyed commands, and their ids.
#include "server/station/commands/recent_commands.hpp"

#include <gtest/gtest.h>

namespace server {
namespace {

TEST(RecentCommands, ForgetsTheOldestBeyondItsLimit) {
  station::RecentCommands recent;
  station::CommandRecord record;
  for (station::CommandId id = 1; id <= station::RecentCommands::kMaxCommands + 1; ++id) {
    record.id = id;
    recent.put(record, static_cast<std::int64_t>(id));
  }
  EXPECT_EQ(recent.find(1), nullptr);
  ASSERT_NE(recent.find(2), nullptr);
  EXPECT_EQ(recent.find(2)->answered_us, 2);
}

TEST(RecentCommands, KeepsTheLatestRecordAndTheFirstTime) {
  station::RecentCommands recent;
  station::CommandRecord record;
  record.id = 5;
  record.state = station::CommandState::acknowledged;
  recent.put(record, 10);
  record.state = station::CommandState::verified;
  recent.put(record, 20);
  EXPECT_EQ(recent.find(5)->record.state, station::CommandState::verified);
  EXPECT_EQ(recent.find(5)->answered_us, 10);
}

TEST(CommandKey, TheIdDependsOnRobotActorAndKey) {
  const station::CommandId id = station::command_id_of("r1", "token:local", "a");
  EXPECT_EQ(id, station::command_id_of("r1", "token:local", "a"));
  EXPECT_NE(id, station::command_id_of("r2", "token:local", "a"));
  EXPECT_NE(id, station::command_id_of("r1", "session:1", "a"));
  EXPECT_NE(id, station::command_id_of("r1", "token:local", "b"));
}

TEST(CommandKey, IsShortAndPrintable) {
  EXPECT_TRUE(station::is_command_key("7f31-A.b_c:9"));
  EXPECT_TRUE(station::is_command_key(std::string(64, 'x')));
  for (const char* key : {"", "a b", "a\n", "\xc3\xa4", "a/b"}) EXPECT_FALSE(station::is_command_key(key)) << key;
  EXPECT_FALSE(station::is_command_key(std::string(65, 'x')));
}

}  // namespace
}  // namespace server
