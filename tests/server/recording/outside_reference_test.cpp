// References in the database: written in pieces, replaced, and deleted with their run.
#include "server/storage/runs/outside_reference.hpp"

#include <gmock/gmock.h>
#include <sqlite3.h>

#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/upkeep/store_check.hpp"
#include "tests/server/recording/retention_fixture.hpp"

namespace server {
namespace {

using ::testing::IsEmpty;

class OutsideReferenceTest : public RetentionTest {
 protected:
  storage::RunId make_run() {
    keep(0);
    const storage::RunId run = wait(runs_->create(robot_.id, named("swim"))).value().id;
    record(100);
    wait(runs_->end(run, ""));
    return run;
  }
  static storage::OutsideReference reference_of(storage::RunId run, const std::string& source = "camera.csv") {
    storage::OutsideReference reference;
    reference.run = run;
    reference.source = source;
    reference.clock = storage::ReferenceClock::correlation;
    reference.clock_offset_s = 1.5;
    reference.clock_sd_s = 0.002;
    reference.correlation = 0.998;
    reference.actor = "token:ana";
    reference.made_at_us = 7;
    return reference;
  }
  static storage::OutsidePositions positions(std::size_t count) {
    storage::OutsidePositions made;
    for (std::size_t i = 0; i < count; ++i) {
      made.robot_time_us.push_back(1000 * i);
      made.position_m.push_back(0.5);
      made.position_sd_m.push_back(0.001);
    }
    return made;
  }
  Result<storage::OutsideReference> import(const storage::OutsideReference& reference, std::size_t count,
                                           const std::string& reason = "") {
    storage::OutsideReference counted = reference;
    counted.samples = count;
    return wait(recording_->references.import(std::move(counted), positions(count), reason, {"token:ana", "", 8}));
  }
  std::vector<std::string> faults() {
    SQLite::Database database = storage::open_for_reading(path_);
    return storage::check_store(database, {.run = {}, .integrity = true}).value().faults;
  }
};

TEST_F(OutsideReferenceTest, IsThereAsAWholeAndInOrder) {
  const storage::RunId run = make_run();
  const std::size_t count = 2 * storage::kReferenceSlice + 7;
  const auto made = import(reference_of(run), count);
  ASSERT_TRUE(made) << made.error().detail;
  EXPECT_EQ(made->clock, storage::ReferenceClock::correlation);
  EXPECT_EQ(made->clock_sd_s, 0.002);
  EXPECT_EQ(made->motion_ratio, std::nullopt);
  const storage::OutsidePositions read = wait(recording_->references.page(run, {}, count + 1))->positions;
  ASSERT_EQ(read.size(), count);
  EXPECT_EQ(read.robot_time_us.back(), 1000 * (count - 1));
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(OutsideReferenceTest, ReplacingDeletesThePositionsOfTheOneBeforeAndKeepsItsRow) {
  const storage::RunId run = make_run();
  ASSERT_TRUE(import(reference_of(run), 5000));
  EXPECT_EQ(import(reference_of(run, "second.csv"), 3).error().reason, "has_reference");
  EXPECT_EQ(number("SELECT count(*) FROM outside_position"), 5000);
  ASSERT_TRUE(import(reference_of(run, "second.csv"), 3, "a better camera"));
  EXPECT_EQ(number("SELECT count(*) FROM outside_position"), 3);
  EXPECT_EQ(rows("SELECT source, removed_by, removed_reason FROM outside_reference ORDER BY reference_id"),
            (Rows{"camera.csv|token:ana|a better camera", "second.csv||"}));
}

// Another connection removes it while a reading one has come so far, by each count of SQLite's steps.
TEST_F(OutsideReferenceTest, WhatIsReadWhileItIsRemovedIsWholeOrNothing) {
  const storage::RunId run = make_run();
  ASSERT_TRUE(import(reference_of(run), 30));
  SQLite::Database reader = storage::open_for_reading(path_), writer{path_.string(), SQLite::OPEN_READWRITE};
  struct Removal {
    SQLite::Database& database;
    int steps_left;
    void remove(bool is_removed) {
      database.exec(is_removed
                        ? "BEGIN; UPDATE outside_reference SET removed_at_us = 9; CREATE TEMP TABLE kept AS SELECT"
                          " * FROM outside_position; DELETE FROM outside_position; COMMIT"
                        : "BEGIN; UPDATE outside_reference SET removed_at_us = NULL; INSERT INTO outside_position"
                          " SELECT * FROM kept; DROP TABLE kept; COMMIT");
    }
    static int on_step(void* self) {
      Removal& removal = *static_cast<Removal*>(self);
      if (--removal.steps_left == 0) removal.remove(true);
      return 0;
    }
  };
  int found = 0, not_found = 0;
  for (int steps = 1; not_found + found < 1000; ++steps) {
    Removal removal{writer, steps};
    sqlite3_progress_handler(reader.getHandle(), 1, Removal::on_step, &removal);
    const auto read = storage::read_reference(reader, run);
    sqlite3_progress_handler(reader.getHandle(), 0, nullptr, nullptr);
    ++(read ? found : not_found);
    if (read) ASSERT_EQ(read->positions.size(), 30U) << "removed after " << steps << " steps";
    if (removal.steps_left > 0) break;  // it was read before that
    removal.remove(false);
  }
  EXPECT_GT(found, 30);
  EXPECT_GT(not_found, 0);
}

TEST_F(OutsideReferenceTest, AnExportDuringWhichItIsReplacedHasOneOfTheTwo) {
  const storage::RunId run = make_run();
  ASSERT_TRUE(import(reference_of(run), 12'000));  // three pieces
  SQLite::Database database = storage::open_for_reading(path_);
  const auto file = folder_ / "run.sqlite";
  storage::RunFile writer{file,
                          storage::reading_uri(path_, false),
                          storage::read_spans(database, run, 0),
                          {.run = run, .channels = storage::all_channels(), .grid_us = {}}};
  const auto copied = [&file](const char* sql) {
    SQLite::Database made{file.string(), SQLite::OPEN_READONLY};
    return made.tableExists("outside_position") ? made.execAndGet(sql).getInt64() : 0;
  };
  do {
    ASSERT_TRUE(writer.advance(database));
  } while (copied("SELECT count(*) FROM outside_position") == 0);
  ASSERT_TRUE(import(reference_of(run, "second.csv"), 70, "a better camera"));
  while (writer.advance(database)) continue;
  EXPECT_EQ(copied("SELECT count(*) FROM outside_position"), 70);
  EXPECT_EQ(copied("SELECT samples FROM outside_reference WHERE source = 'second.csv'"), 70);
}

TEST_F(OutsideReferenceTest, GoesWithItsRun) {
  const storage::RunId run = make_run();
  ASSERT_TRUE(import(reference_of(run), 5000));
  pass();
  EXPECT_EQ(number("SELECT count(*) FROM outside_position"), 5000);  // the run holds it
  wait(runs_->discard(run, "loose tube", {}));
  EXPECT_EQ(wait(recording_->references.find(run)).error().code, ErrorCode::not_found);
  pass();
  EXPECT_EQ(number("SELECT count(*) FROM outside_position"), 0);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(OutsideReferenceTest, ADiscardedRunIsExportedWithoutItsReference) {
  const storage::RunId run = make_run();
  ASSERT_TRUE(import(reference_of(run), 5000));
  wait(runs_->discard(run, "loose tube", {}));
  pass();
  SQLite::Database database = storage::open_for_reading(path_);
  const auto file = folder_ / "run.sqlite";
  storage::RunFile writer{file,
                          storage::reading_uri(path_, false),
                          storage::read_spans(database, run, 0),
                          {.run = run, .channels = storage::all_channels(), .grid_us = {}}};
  while (writer.advance(database)) continue;
  SQLite::Database made{file.string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(made.execAndGet("SELECT count(*) FROM sample").getInt(), 100);
  EXPECT_EQ(made.execAndGet("SELECT count(*) FROM outside_reference").getInt(), 0);
}

// The station was killed between two pieces.
TEST_F(OutsideReferenceTest, WhatWasNotFinishedIsNeverInUse) {
  const storage::RunId run = make_run();
  wait(recorder_->on_disk([run](storage::Database& database) {
    const auto id = begin_reference(database.handle(), reference_of(run), "");
    add_positions(database.handle(), *id, positions(10), 0, 10);
    return true;
  }));
  EXPECT_EQ(wait(recording_->references.find(run)).error().reason, "no_reference");
  kill();
  keep(0);
  pass();
  EXPECT_EQ(number("SELECT count(*) FROM outside_position"), 0);
  EXPECT_EQ(wait(recording_->references.find(run)).error().reason, "no_reference");
  ASSERT_TRUE(import(reference_of(run), 10));
}

TEST_F(OutsideReferenceTest, VerifyNamesPositionsOfNoReference) {
  const storage::RunId run = make_run();
  ASSERT_TRUE(import(reference_of(run), 10));
  stop();
  {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
    database.exec("PRAGMA foreign_keys = OFF; DELETE FROM outside_reference");
  }
  EXPECT_THAT(faults(), ::testing::Contains("a row of outside_position names a outside_reference that is not there"));
}

}  // namespace
}  // namespace server
