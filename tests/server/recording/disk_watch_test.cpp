// Little room on the disk: a warning, then nothing new, and by itself all well again.
#include "server/storage/upkeep/disk_watch.hpp"

#include <gmock/gmock.h>

#include "tests/server/captured_log.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;
constexpr std::uint64_t kMegabyte = 1'000'000;

TEST(SpaceState, IsLeftWithATenthMoreThanItsLimit) {
  const storage::SpaceLimits limits{1000, 500};
  const auto after = [&](storage::SpaceState now, std::uint64_t free) { return next_state(now, free, limits); };
  EXPECT_EQ(after(storage::SpaceState::ok, 1000), storage::SpaceState::ok);
  EXPECT_EQ(after(storage::SpaceState::ok, 999), storage::SpaceState::low);
  EXPECT_EQ(after(storage::SpaceState::ok, 499), storage::SpaceState::critical);
  EXPECT_EQ(after(storage::SpaceState::low, 1099), storage::SpaceState::low);
  EXPECT_EQ(after(storage::SpaceState::low, 1100), storage::SpaceState::ok);
  EXPECT_EQ(after(storage::SpaceState::low, 500), storage::SpaceState::low);
  EXPECT_EQ(after(storage::SpaceState::critical, 549), storage::SpaceState::critical);
  EXPECT_EQ(after(storage::SpaceState::critical, 550), storage::SpaceState::low);
  EXPECT_EQ(after(storage::SpaceState::critical, 1099), storage::SpaceState::low);
  EXPECT_EQ(after(storage::SpaceState::critical, 1100), storage::SpaceState::ok);
}

TEST(SpaceState, WithoutLimitsThereIsAlwaysRoom) {
  EXPECT_EQ(next_state(storage::SpaceState::ok, 0, {}), storage::SpaceState::ok);
}

class DiskWatchTest : public RecordingTest {
 protected:
  void begin() {
    start({}, {.retention_days = 0,
               .event_retention_days = 0,
               .max_database_mb = 0,
               .low_space_mb = 2000,
               .critical_space_mb = 500,
               .backup_dir = {},
               .give_up_after_days = 0});
  }
  // From now on the disk has so much room, and the watch has looked.
  void set_free(std::uint64_t megabytes) {
    recording_->disk_watch.set_free_bytes([megabytes](const std::filesystem::path&) { return megabytes * kMegabyte; });
    clock_.run_for(6s);
  }
  storage::DiskWatch& watch() { return recording_->disk_watch; }
};

TEST_F(DiskWatchTest, SaysHowMuchRoomIsLeftAndWhatToDo) {
  begin();
  set_free(3000);
  EXPECT_EQ(watch().problem(), "");
  set_free(1999);
  EXPECT_EQ(watch().state(), storage::SpaceState::low);
  EXPECT_THAT(watch().problem(), HasSubstr("1999 MB are free"));
  EXPECT_THAT(watch().problem(), HasSubstr("the low_space_mb limit is 2000 MB: make room"));
  EXPECT_TRUE(watch().may_begin("a run"));
  EXPECT_EQ(watch().use().free_bytes, 1999 * kMegabyte);
  EXPECT_GT(watch().use().database_bytes, 0U);
}

TEST_F(DiskWatchTest, WhenItIsCriticalNothingNewBeginsAndRecordingGoesOnUntilItRecovers) {
  begin();
  set_free(100);
  const Result<void> refused = watch().may_begin("a run");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unavailable);
  EXPECT_EQ(refused.error().reason, "low_space");
  EXPECT_THAT(refused.error().detail, HasSubstr("a run cannot be begun: 100 MB are free"));
  EXPECT_FALSE(wait(recording_->backups.begin("monday")));

  TestRobot robot;
  connect(robot);
  make(robot, 300);
  flush();
  EXPECT_EQ(durable_next_seq_, 300U) << "recording goes on";

  set_free(5000);
  EXPECT_EQ(watch().state(), storage::SpaceState::ok);
  EXPECT_TRUE(watch().may_begin("a run"));
}

TEST_F(DiskWatchTest, ADiskThatDoesNotAnswerIsAsItWas) {
  begin();
  set_free(100);
  watch().set_free_bytes([](const std::filesystem::path&) -> std::uint64_t {
    throw std::filesystem::filesystem_error{"statvfs", std::make_error_code(std::errc::io_error)};
  });
  clock_.run_for(6s);
  EXPECT_EQ(watch().state(), storage::SpaceState::critical);
  EXPECT_EQ(watch().use().free_bytes, 100 * kMegabyte);
}

TEST_F(DiskWatchTest, WarnsEachHourOfAFileSystemThatDamagesAStore) {
  begin();
  const CapturedLog log;
  int asked = 0;
  watch().set_file_system([&asked](const std::filesystem::path&) {
    ++asked;
    return std::string{"NFS"};
  });
  clock_.run_for(std::chrono::hours{3} + std::chrono::minutes{1});
  EXPECT_EQ(asked, 3);
  EXPECT_THAT(log.text(), HasSubstr("is on NFS, where a store can be damaged"));
}

}  // namespace
}  // namespace server
