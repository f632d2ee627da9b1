// The owner of the writing handle: it opens, writes, reports how long the log is, and closes with the audit's last
// entry.
#include "server/storage/commits/database_worker.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>

#include "server/runtime/tasks.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;

class DatabaseWorkerTest : public ::testing::Test {
 protected:
  ~DatabaseWorkerTest() override { std::filesystem::remove_all(folder_); }

  storage::OpenedDatabase open() { return runtime::run_first(loop_, database_.open(clock_.utc_us())); }
  std::string write(const storage::WriteBatch& commit) { return runtime::run_first(loop_, database_.write(commit)); }
  void execute(const std::string& sql) {
    auto job = [sql](storage::Database& database) { return database.handle().exec(sql); };
    runtime::run_first(loop_, database_.run(std::move(job)));
  }
  std::int64_t number(const std::string& sql) {
    auto job = [sql](storage::Database& database) { return database.handle().execAndGet(sql).getInt64(); };
    return runtime::run_first(loop_, database_.run(std::move(job)));
  }
  static std::filesystem::path new_folder() {
    std::string name = (std::filesystem::temp_directory_path() / "rheonaut-worker-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + name};
    return name;
  }
  static station::AuditNote note(const std::string& action) {
    station::AuditNote note;
    note.by.actor = "station";
    note.action = action;
    return note;
  }
  static storage::WriteBatch commit_of(const std::string& action) {
    storage::WriteBatch commit;
    commit.audit.push_back(note(action));
    return commit;
  }
  std::int64_t entries(const std::string& action) {
    return number("SELECT count(*) FROM audit WHERE action = '" + action + "'");
  }

  const std::filesystem::path folder_ = new_folder();
  const std::filesystem::path path_ = folder_ / "station.sqlite";
  boost::asio::io_context loop_{1};
  runtime::SystemClock clock_{loop_};
  runtime::WorkerThread disk_{"disk"};
  runtime::WorkerThread checkpoints_{"checkpoints"};
  storage::Checkpointer checkpointer_{loop_, clock_, checkpoints_, path_, 64 << 20, 10s};
  storage::DatabaseWorker database_{disk_, checkpointer_, path_};
};

TEST_F(DatabaseWorkerTest, ANewDatabaseHasItsIdAndNoBoots) {
  EXPECT_FALSE(database_.is_open());
  const storage::OpenedDatabase opened = open();
  EXPECT_TRUE(database_.is_open());
  EXPECT_NE(opened.restored.store_id, 0U);
  EXPECT_TRUE(opened.restored.robots.empty());
  EXPECT_EQ(opened.next_boot_key, 1);
  EXPECT_EQ(opened.restored_at_us, 0);
}

TEST_F(DatabaseWorkerTest, AFileOfAnotherProgramIsNotOpened) {
  std::ofstream{path_} << "these are the notes of somebody else";
  EXPECT_THROW(open(), std::exception);
  EXPECT_FALSE(database_.is_open());
}

TEST_F(DatabaseWorkerTest, ACommitIsWrittenAndTheLengthOfTheLogReported) {
  open();
  EXPECT_EQ(checkpointer_.state().bytes, 0U);
  EXPECT_EQ(write(commit_of("a")), "");
  EXPECT_EQ(entries("a"), 1);
  EXPECT_GT(checkpointer_.state().bytes, 0U);
  runtime::run_first(loop_, checkpointer_.next_commit());  // returns, since something was committed
}

TEST_F(DatabaseWorkerTest, OfACommitThatFailsNothingIsStoredAndItCanBeWrittenAgain) {
  open();
  storage::WriteBatch commit = commit_of("a");
  execute("CREATE TEMP TRIGGER refuse BEFORE INSERT ON event BEGIN SELECT RAISE(ABORT, 'no room'); END");
  station::RobotEvent event;
  event.robot_id = "nemo";
  event.kind = "connected";
  commit.events.push_back({0, event});
  EXPECT_NE(write(commit).find("no room"), std::string::npos);
  EXPECT_EQ(entries("a"), 0);
  execute("DROP TRIGGER temp.refuse");
  EXPECT_EQ(write(commit), "");
  EXPECT_EQ(entries("a"), 1);
  EXPECT_EQ(number("SELECT count(*) FROM event"), 1);
}

TEST_F(DatabaseWorkerTest, AnExceptionOfAJobReachesItsCallerAndTheNextJobRuns) {
  open();
  EXPECT_THROW(execute("this is no SQL"), SQLite::Exception);
  EXPECT_EQ(number("SELECT 7"), 7);
}

TEST_F(DatabaseWorkerTest, ClosingWritesTheLastEntryOfTheAuditAndEmptiesTheLog) {
  open();
  write(commit_of("a"));
  // With another reader of the file SQLite leaves the log as it is.
  SQLite::Database reader{path_.string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(reader.execAndGet("SELECT count(*) FROM audit").getInt(), 1);
  bool had_database = false;
  database_.close([&](storage::Database& database, std::int64_t) { had_database = database.store_id() != 0; }, clock_,
                  note("station.stopped"));
  EXPECT_TRUE(had_database);
  EXPECT_FALSE(database_.is_open());
  EXPECT_EQ(std::filesystem::file_size(path_.string() + "-wal"), 0U);
  open();
  EXPECT_EQ(number("SELECT action = 'station.stopped' FROM audit ORDER BY entry DESC LIMIT 1"), 1);
}

TEST_F(DatabaseWorkerTest, ClosingGoesOnWhenTheLastJobFails) {
  open();
  database_.close([](storage::Database&, std::int64_t) { throw std::runtime_error{"no disk"}; }, clock_,
                  note("station.stopped"));
  EXPECT_FALSE(database_.is_open());
}

}  // namespace
}  // namespace server
