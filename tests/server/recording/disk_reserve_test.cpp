// The file that holds room for the next start.
#include "server/storage/database/disk_reserve.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

constexpr std::uint64_t kMuch = 1'000 * kDiskReserveBytes;

class DiskReserveTest : public RecordingTest {
 protected:
  DiskReserveTest() { std::filesystem::create_directory(database_.parent_path()); }

  std::filesystem::path database_ = folder_ / "disk" / "station.sqlite";  // nobody opens it
  std::filesystem::path reserve_ = disk_reserve_of(database_);
};

TEST_F(DiskReserveTest, HoldsBlocksAndNotOnlyALength) {
  keep_disk_reserve(database_, kMuch);
  struct stat status{};
  ASSERT_EQ(::stat(reserve_.c_str(), &status), 0);
  EXPECT_EQ(status.st_size, static_cast<off_t>(kDiskReserveBytes));
  EXPECT_GE(status.st_blocks * 512, status.st_size);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

TEST_F(DiskReserveTest, IsGivenUpOnlyWhenTheDiskIsFull) {
  keep_disk_reserve(database_, kMuch);
  give_up_disk_reserve(database_, kDiskReserveBytes);
  EXPECT_TRUE(std::filesystem::exists(reserve_));
  give_up_disk_reserve(database_, kDiskReserveBytes - 1);
  EXPECT_FALSE(std::filesystem::exists(reserve_));
  give_up_disk_reserve(database_, 0);  // there is none to give up
}

TEST_F(DiskReserveTest, IsNotMadeWhileThereIsLittleRoom) {
  keep_disk_reserve(database_, 10 * kDiskReserveBytes - 1);
  EXPECT_FALSE(std::filesystem::exists(reserve_));
}

TEST_F(DiskReserveTest, OneThatWasCutShortIsMadeWhole) {
  std::ofstream{reserve_} << "short";
  keep_disk_reserve(database_, kMuch);
  EXPECT_EQ(std::filesystem::file_size(reserve_), kDiskReserveBytes);
}

}  // namespace
}  // namespace server
