// The files of an open database are taken away: what it holds stays under another name, and is found by the next start.
#include "server/storage/database/kept_files.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <chrono>
#include <filesystem>

#include "server/storage/database/database.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using storage::Database;
using storage::KeptFiles;

class KeptFilesTest : public ::testing::Test {
 protected:
  KeptFilesTest() { commit(1); }
  ~KeptFilesTest() override {
    database_.reset();
    for (const fs::path& each : {folder_, elsewhere_, backups_}) fs::remove_all(each);
  }

  static fs::path new_folder() {
    std::string name = (fs::temp_directory_path() / "rheonaut-kept-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + name};
    return name;
  }
  void commit(int commits) {
    database_->handle().exec("INSERT INTO meta (name, value) VALUES ('commits', " + std::to_string(commits) +
                             ") ON CONFLICT (name) DO UPDATE SET value = excluded.value");
  }
  static std::int64_t commits_in(const fs::path& path) {
    SQLite::Database database{path.string(), SQLite::OPEN_READONLY};
    return database.execAndGet("SELECT value FROM meta WHERE name = 'commits'").getInt64();
  }
  std::string problem() { return kept_->problem(database_->handle()); }
  // What a kill leaves, in another folder: the names lead to one file each, as they did.
  fs::path killed() {
    fs::remove_all(elsewhere_);
    EXPECT_EQ(std::system(("cp -a " + folder_.string() + " " + elsewhere_.string()).c_str()), 0);
    return elsewhere_ / "station.sqlite";
  }
  // The next start; the folders that it names.
  static std::vector<fs::path> start(const fs::path& path) {
    storage::settle_kept_files(path);
    Database database{path};
    const KeptFiles kept{path, {}};
    return storage::folders_set_aside(path);
  }
  static fs::path log_of(const fs::path& path) { return path.string() + "-wal"; }

  const fs::path folder_ = new_folder(), elsewhere_ = new_folder(), backups_ = new_folder();
  const fs::path path_ = folder_ / "station.sqlite";
  std::unique_ptr<Database> database_ = std::make_unique<Database>(path_);
  std::unique_ptr<KeptFiles> kept_ = std::make_unique<KeptFiles>(path_, storage::RescuePlace{backups_, 0});
};

TEST_F(KeptFilesTest, AnOrderlyEndLeavesNothing) {
  EXPECT_EQ(problem(), "");
  EXPECT_TRUE(fs::exists(storage::kept_folder_of(path_)));
  kept_->remove();
  database_.reset();
  EXPECT_FALSE(fs::exists(storage::kept_folder_of(path_)));
  EXPECT_EQ(start(path_), std::vector<fs::path>{});
}

TEST_F(KeptFilesTest, ADatabaseThatLosesItsNameIsNamedAndHasItAgainWhenItIsPutBack) {
  commit(2);
  fs::rename(path_, folder_ / "away");
  EXPECT_NE(problem().find("station.sqlite was removed, renamed or replaced"), std::string::npos) << problem();
  EXPECT_NE(problem().find("station.kept"), std::string::npos);
  fs::rename(folder_ / "away", path_);
  EXPECT_EQ(problem(), "");
}

TEST_F(KeptFilesTest, ALogThatLosesItsNameIsMovedIntoTheDatabaseAndHasItAgain) {
  for (const char* ending : {"-wal", "-shm"}) {
    commit(2);
    fs::remove(path_.string() + ending);
    EXPECT_EQ(problem(), "");
    EXPECT_TRUE(fs::exists(path_.string() + ending));
    fs::rename(path_.string() + ending, folder_ / "away");
    fs::copy_file(folder_ / "away", path_.string() + ending);  // of another one
    EXPECT_EQ(problem(), "");
    EXPECT_TRUE(fs::exists(path_.string() + ending + ".foreign-1"));
    fs::remove(folder_ / "away");
  }
  commit(3);
  EXPECT_EQ(problem(), "");
  const fs::path left = killed();
  EXPECT_EQ(start(left), std::vector<fs::path>{});
  EXPECT_EQ(commits_in(left), 3);
}

TEST_F(KeptFilesTest, AfterAKillNothingIsLeftWhereTheNamesAreRight) {
  commit(2);
  const fs::path left = killed();
  EXPECT_EQ(start(left), std::vector<fs::path>{});
  EXPECT_EQ(commits_in(left), 2);
}

TEST_F(KeptFilesTest, AfterAKillADatabaseThatLostItsNameIsNamed) {
  commit(2);
  fs::remove(path_);
  EXPECT_NE(problem(), "");
  const fs::path left = killed();
  const auto aside = start(left);
  ASSERT_EQ(aside.size(), 1U);
  EXPECT_EQ(commits_in(aside[0] / "station.sqlite"), 2);
  EXPECT_EQ(start(left).size(), 1U) << "each start names it";
}

// As with cp of a backup: the log beside it is of the database that was there.
TEST_F(KeptFilesTest, AfterAKillAnotherDatabaseIsNotWrittenByTheLogOfTheFirst) {
  const fs::path other = backups_ / "other.sqlite";
  {
    Database{other};
    SQLite::Database{other.string(), SQLite::OPEN_READWRITE}.exec(
        "INSERT INTO meta (name, value) VALUES ('commits', 5)");
  }
  commit(2);
  fs::remove(path_);
  fs::copy_file(other, path_);
  EXPECT_NE(problem(), "");
  EXPECT_FALSE(kept_->hold());
  const fs::path left = killed();
  const auto aside = start(left);
  ASSERT_EQ(aside.size(), 1U);
  EXPECT_EQ(commits_in(aside[0] / "station.sqlite"), 2);
  EXPECT_EQ(commits_in(left), 5);
}

TEST_F(KeptFilesTest, ALogThatIsRemovedAfterAKillIsSetAsideWhereItWasWrittenLast) {
  commit(2);
  const fs::path left = killed();
  fs::last_write_time(log_of(left), fs::last_write_time(left) + std::chrono::seconds{1});
  fs::remove(log_of(left));
  const auto aside = start(left);
  ASSERT_EQ(aside.size(), 1U);
  EXPECT_GT(fs::file_size(aside[0] / "station.sqlite-wal"), 0U);
  EXPECT_FALSE(fs::exists(aside[0] / "station.sqlite")) << "a second name of the database that is in use";
}

TEST_F(KeptFilesTest, AnotherProgramThatHasMovedTheLogAfterAKillLeavesNothing) {
  commit(2);
  const fs::path left = killed();
  {
    SQLite::Database{left.string(), SQLite::OPEN_READWRITE}.execAndGet("SELECT count(*) FROM meta");
  }
  ASSERT_FALSE(fs::exists(log_of(left)));
  {
    SQLite::Database{left.string(), SQLite::OPEN_READWRITE}.exec("UPDATE meta SET value = 7 WHERE name = 'commits'");
  }
  EXPECT_EQ(start(left), std::vector<fs::path>{});
  EXPECT_EQ(commits_in(left), 7) << "an old log is not put back beside it";
}

TEST_F(KeptFilesTest, WithoutSecondNamesItIsCopied) {
  commit(2);
  fs::remove_all(storage::kept_folder_of(path_));
  fs::remove(path_);
  EXPECT_NE(problem().find("station.kept-1"), std::string::npos) << problem();
  EXPECT_EQ(commits_in(folder_ / "station.kept-1" / "station.sqlite"), 2);
}

TEST_F(KeptFilesTest, WithoutItsFolderItIsCopiedToTheBackups) {
  commit(2);
  fs::remove_all(folder_);
  EXPECT_NE(problem().find(backups_.string()), std::string::npos) << problem();
  EXPECT_EQ(commits_in(backups_ / "station.kept-1" / "station.sqlite"), 2);
}

}  // namespace
}  // namespace server
