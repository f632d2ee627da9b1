// The file that holds room for the next start.
#include "server/storage/database/disk_reserve.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

constexpr std::uint64_t kMuch = 1'000 * storage::kDiskReserveBytes;

class DiskReserveTest : public RecordingTest {
 protected:
  DiskReserveTest() { std::filesystem::create_directory(database_.parent_path()); }

  std::filesystem::path database_ = folder_ / "disk" / "station.sqlite";  // nobody opens it
  std::filesystem::path reserve_ = storage::disk_reserve_of(database_);
};

TEST_F(DiskReserveTest, HoldsBlocksAndNotOnlyALength) {
  storage::keep_disk_reserve(database_, kMuch);
  struct stat status{};
  ASSERT_EQ(::stat(reserve_.c_str(), &status), 0);
  EXPECT_EQ(status.st_size, static_cast<off_t>(storage::kDiskReserveBytes));
  EXPECT_GE(status.st_blocks * 512, status.st_size);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

TEST_F(DiskReserveTest, IsGivenUpOnlyWhenTheDiskIsFull) {
  storage::keep_disk_reserve(database_, kMuch);
  storage::give_up_disk_reserve(database_, storage::kDiskReserveBytes);
  EXPECT_TRUE(std::filesystem::exists(reserve_));
  storage::give_up_disk_reserve(database_, storage::kDiskReserveBytes - 1);
  EXPECT_FALSE(std::filesystem::exists(reserve_));
  storage::give_up_disk_reserve(database_, 0);  // there is none to give up
}

TEST_F(DiskReserveTest, IsNotMadeWhileThereIsLittleRoom) {
  storage::keep_disk_reserve(database_, 10 * storage::kDiskReserveBytes - 1);
  EXPECT_FALSE(std::filesystem::exists(reserve_));
}

TEST_F(DiskReserveTest, OneThatWasCutShortIsMadeWhole) {
  std::ofstream{reserve_} << "short";
  storage::keep_disk_reserve(database_, kMuch);
  EXPECT_EQ(std::filesystem::file_size(reserve_), storage::kDiskReserveBytes);
}

}  // namespace
}  // namespace server
