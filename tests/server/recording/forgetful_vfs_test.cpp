// The disk that forgets: SQLite on it keeps what it synced, and what it did not sync may go.
#include "tests/server/recording/forgetful_vfs.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <set>

namespace server {
namespace {

class ForgetfulVfsTest : public ::testing::Test {
 protected:
  ForgetfulVfsTest() {
    std::string folder = (std::filesystem::temp_directory_path() / "rheonaut-test-XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + folder};
    folder_ = folder;
    begin(0);
    SQLite::Database database = open();
    database.exec("CREATE TABLE t (n INTEGER); INSERT INTO t VALUES (1)");
  }
  ~ForgetfulVfsTest() override { std::filesystem::remove_all(folder_); }

  void begin(std::uint64_t last_call) { vfs_.begin(survival_, last_call); }

  SQLite::Database open(const char* synchronous = "FULL") {
    SQLite::Database database{(folder_ / "t.sqlite").string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
    database.exec("PRAGMA journal_mode = WAL");
    database.exec(std::string{"PRAGMA synchronous = "} + synchronous);
    return database;
  }

  int rows() { return open().execAndGet("SELECT count(*) FROM t").getInt(); }

  // Inserts until the power fails; returns the number of rows whose commit succeeded.
  int insert_until_cut(const char* synchronous, std::uint64_t calls) {
    int committed = 1;
    SQLite::Database database = open(synchronous);
    begin(calls);
    try {
      for (; committed < 1000; ++committed) database.exec("INSERT INTO t VALUES (2)");
    } catch (const SQLite::Exception& error) {
      EXPECT_EQ(error.getErrorCode(), SQLITE_IOERR);
    }
    EXPECT_TRUE(vfs_.has_failed());
    return committed;
  }

  std::mt19937 random_{1};
  Survival survival_ = Survival::nothing;
  ForgetfulVfs vfs_;
  std::filesystem::path folder_;
};

TEST_F(ForgetfulVfsTest, KeepsEveryCommitThatWasSynced) {
  for (const Survival survival : {Survival::nothing, Survival::sectors, Survival::torn}) {
    survival_ = survival;
    for (std::uint64_t calls = 1; calls < 40; ++calls) {
      begin(0);
      open().exec("DELETE FROM t; INSERT INTO t VALUES (1)");
      const int committed = insert_until_cut("FULL", calls);
      vfs_.lose_power(random_);
      begin(0);
      EXPECT_GE(rows(), committed) << text(survival) << ", " << calls << " calls";
      EXPECT_LE(rows(), committed + 1) << text(survival) << ", " << calls << " calls";
    }
  }
}

TEST_F(ForgetfulVfsTest, ForgetsACommitThatWasNotSynced) {
  EXPECT_GT(insert_until_cut("OFF", 60), 10);
  vfs_.lose_power(random_);
  begin(0);
  EXPECT_EQ(rows(), 1);
}

TEST_F(ForgetfulVfsTest, AKillForgetsNothingButMakesNothingDurable) {
  const int committed = insert_until_cut("OFF", 60);
  EXPECT_EQ(vfs_.failed_call().empty(), false);
  begin(0);
  {
    SQLite::Database reading{(folder_ / "t.sqlite").string(), SQLite::OPEN_READONLY};
    EXPECT_GE(reading.execAndGet("SELECT count(*) FROM t").getInt(), committed);
  }
  vfs_.lose_power(random_);
  EXPECT_EQ(rows(), 1);
}

TEST_F(ForgetfulVfsTest, ReportsAFullDiskAsOftenAsRequested) {
  SQLite::Database database = open();
  vfs_.refuse_writes(1);
  EXPECT_THROW(database.exec("INSERT INTO t VALUES (2)"), SQLite::Exception);
  database.exec("INSERT INTO t VALUES (3)");
  EXPECT_EQ(database.execAndGet("SELECT group_concat(n) FROM t").getString(), "1,3");
}

TEST_F(ForgetfulVfsTest, ARemovalThatWasNotSyncedMayBeUndone) {
  const std::filesystem::path path = folder_ / "file";
  ForgetfulDisk disk;
  const std::shared_ptr<DiskFile> file = disk.open(path);
  file->write(0, "bytes");
  disk.sync(path, file);
  std::filesystem::remove(path);
  disk.remove(path);
  disk.lose_power(Survival::nothing, random_);
  EXPECT_EQ(std::filesystem::file_size(path), 5u);
  disk.open(path);
  std::filesystem::remove(path);
  disk.remove(path);
  disk.sync_folder();
  disk.lose_power(Survival::nothing, random_);
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(DiskFile, ASectorHasAnyOfItsContentsAndATornOneAlsoAPartOrNoise) {
  DiskFile file{std::string(2 * kDiskSectorBytes, 'a')};
  file.write(kDiskSectorBytes, std::string(kDiskSectorBytes / 2, 'b'));
  file.write(kDiskSectorBytes, std::string(kDiskSectorBytes / 2, 'c'));
  std::mt19937 random{1};
  std::set<std::string> whole;
  std::set<std::string> torn;
  for (int i = 0; i < 1000; ++i) {
    whole.insert(file.after_power_cut(Survival::sectors, random).substr(kDiskSectorBytes));
    const std::string content = file.after_power_cut(Survival::torn, random);
    EXPECT_EQ(content.substr(0, kDiskSectorBytes), std::string(kDiskSectorBytes, 'a'));
    torn.insert(content.substr(kDiskSectorBytes));
  }
  EXPECT_EQ(whole.size(), 3u);
  EXPECT_GT(torn.size(), 50u);
  file.sync();
  EXPECT_EQ(file.after_power_cut(Survival::nothing, random)[kDiskSectorBytes], 'c');
}

}  // namespace
}  // namespace server
