// The digest says of a run exactly what a naive recount of its samples says.
#include "server/storage/runs/run_digest.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <map>

#include "server/storage/database/statement.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class RunDigestTest : public RecordingTest {
 protected:
  TestRobot robot_;

  storage::RunId create() { return wait(runs_->create(robot_.id, named("certified")))->id; }
  void end(storage::RunId id) { ASSERT_TRUE(wait(runs_->end(id, "")).has_value()); }
  storage::RunDigest final_digest(storage::RunId id) {
    const Result<storage::CurrentDigest> found = wait(recording_->digester.find(id));
    EXPECT_TRUE(found.has_value()) << found.error().detail;
    EXPECT_TRUE(found && found->is_final);
    return found ? found->digest : storage::RunDigest{};
  }
  void reboot() {
    disconnect(robot_);
    robot_.boot_id += 1;
    robot_.next_seq = robot_.oldest_seq = 0;
    connect(robot_);
  }
  void change(const std::string& sql) {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE, 5000};
    database.exec(sql);
  }

  // 300 samples in two boots, 7 of them backfilled, and 10 lost.
  storage::RunId make_eventful_run() {
    connect(robot_);
    make(robot_, 20);
    const storage::RunId id = create();
    make(robot_, 93);
    robot_.next_seq += 7;
    make(robot_, 100);
    TestRobot late = robot_;
    late.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
    send(late, 113, 7);
    robot_.next_seq += 10;  // never arrive
    make(robot_, 50);
    reboot();
    robot_.context.setpoint_m = 0.1F;
    make(robot_, 50);
    end(id);
    return id;
  }
};

TEST_F(RunDigestTest, CountsWhatCameAndWhatIsLost) {
  start();
  const storage::RunDigest digest = final_digest(make_eventful_run());
  EXPECT_EQ(digest.samples_expected, 310u);
  EXPECT_EQ(digest.samples_live, 293u);
  EXPECT_EQ(digest.samples_backfilled, 7u);
  EXPECT_EQ(digest.samples_lost, 10u);
  EXPECT_EQ(digest.samples_missing(), 0u);
  EXPECT_EQ(digest.lost_by_cause, (std::map<std::string, std::uint64_t>{{"reboot", 10}}));
  EXPECT_EQ(digest.longest_gap_samples, 10u);
  EXPECT_EQ(digest.longest_gap_us, 100'000);
  EXPECT_EQ(digest.worst_clock_uncertainty_us, 300);
  EXPECT_EQ(digest.samples_without_clock, 0u);
  EXPECT_EQ(digest.made_at_us, clock_.utc_us());
}

// The bytes of docs/database.md, made another way: each sample as on its page, written member by member.
TEST_F(RunDigestTest, HashesTheDocumentedBytes) {
  start();
  robot_.context.controller_id = 7;
  robot_.context.emergency_id = 0xfedcba9876543210;
  robot_.context.position_sd_m = 0.25F;
  robot_.context.disturbance_m.reset();
  robot_.context.mode = static_cast<protocol::Mode>(300);  // of a newer firmware
  const storage::RunId id = make_eventful_run();
  std::string bytes = "rheonaut-samples-2\n";
  const auto put = [&bytes](std::uint64_t value, int size) {
    for (int byte = 0; byte < size; ++byte) bytes += static_cast<char>(value >> (8 * byte));
  };
  const auto put_float = [&](float value) {
    put(std::isnan(value) ? 0x7fc00000U : std::bit_cast<std::uint32_t>(value), 4);
  };
  for (const storage::StoredSample& one : wait(history_->samples(id, std::nullopt, 10'000))->samples) {
    put(one.boot_id, 8);
    put(one.seq, 8);
    put(one.robot_time_us, 8);
    put(static_cast<std::uint64_t>(one.utc_us), 8);
    put(static_cast<std::uint64_t>(one.clock_uncertainty_us), 8);
    put_float(one.sample.position_m);
    put_float(one.sample.velocity_m_s);
    put_float(one.sample.acceleration_m_s2);
    put_float(one.sample.duty);
    put_float(one.sample.impedance_mv);
    put_float(one.sample.reference_m);
    put_float(one.setpoint_m.value_or(std::nanf("")));
    put_float(station::or_nan(one.disturbance_m));
    put_float(station::or_nan(one.position_sd_m));
    put(static_cast<std::uint64_t>(one.mode), 4);
    put(static_cast<std::uint64_t>(one.sub_state), 4);
    put(static_cast<std::uint64_t>(one.emergency_cause), 4);
    put(one.controller_id, 4);
    put(one.flags, 4);
    put(one.emergency_id, 8);
  }
  ASSERT_EQ(bytes.size(), 19 + 300 * 104u);
  std::array<unsigned char, crypto_hash_sha256_BYTES> hash{};
  crypto_hash_sha256(hash.data(), reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  std::string expected;
  for (const unsigned char byte : hash)
    expected += "0123456789abcdef"[byte >> 4U], expected += "0123456789abcdef"[byte & 15U];
  EXPECT_EQ(final_digest(id).sha256, expected);
}

TEST_F(RunDigestTest, IsFinalOnlyWhenTheLastSampleHasArrived) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 20);
  robot_.next_seq = 40;  // 20..39 are on their way
  make(robot_, 10);
  end(id);
  const Result<storage::CurrentDigest> now = wait(recording_->digester.find(id));
  ASSERT_TRUE(now.has_value());
  EXPECT_FALSE(now->is_final);
  EXPECT_EQ(now->digest.samples_live, 30u);
  EXPECT_EQ(now->digest.samples_missing(), 20u);
  EXPECT_EQ(now->digest.longest_gap_samples, 20u);
  EXPECT_EQ(now->digest.sha256, "");
  EXPECT_EQ(number("SELECT count(*) FROM run_certificate"), 0);
  send(robot_, 20, 20);
  flush();
  EXPECT_EQ(final_digest(id).samples_live, 50u);
}

TEST_F(RunDigestTest, IsMadeByItselfWhenTheRestArrives) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 20);
  robot_.next_seq = 40;
  make(robot_, 10);
  end(id);
  send(robot_, 20, 20);
  clock_.run_for(30s);
  EXPECT_EQ(rows("SELECT run_id, samples_live FROM run_certificate"),
            std::vector<std::string>{std::to_string(id) + "|50"});
}

TEST_F(RunDigestTest, IsMadeWhenTheDiskCanBeWrittenAgain) {
  start();
  change("CREATE TRIGGER full BEFORE INSERT ON run_certificate BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  const storage::RunId id = make_eventful_run();
  const Result<storage::CurrentDigest> now = wait(recording_->digester.find(id));
  ASSERT_TRUE(now.has_value());
  EXPECT_FALSE(now->is_final);
  EXPECT_EQ(now->digest.samples_missing(), 0u);
  change("DROP TRIGGER full");
  clock_.run_for(60s);
  EXPECT_EQ(number("SELECT count(*) FROM run_certificate"), 1);
}

TEST_F(RunDigestTest, ADamagedRunHasNoneAndTheStationGoesOn) {
  start();
  connect(robot_);
  const storage::RunId damaged = create();
  make(robot_, 100);
  flush();
  change("DELETE FROM sample WHERE row = 7");
  end(damaged);
  const Result<storage::CurrentDigest> found = wait(recording_->digester.find(damaged));
  ASSERT_TRUE(found.has_value());
  EXPECT_FALSE(found->is_final);
  const storage::RunId next = create();
  make(robot_, 20);
  end(next);
  EXPECT_EQ(final_digest(next).samples_live, 20u);
  EXPECT_EQ(number("SELECT count(*) FROM run_certificate"), 1);
}

TEST_F(RunDigestTest, IsMadeAfterARestartForARunThatTheStopInterrupted) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 250);
  flush();
  kill();
  start();
  clock_.run_for(1s);
  EXPECT_EQ(number("SELECT count(*) FROM run_certificate"), 1);
  EXPECT_EQ(final_digest(id).samples_live, 250u);
}

TEST_F(RunDigestTest, AThousandRunsAreListedFromTheirDigestsWithoutASegment) {
  start();
  const storage::RunId id = make_eventful_run();
  final_digest(id);
  change(
      "CREATE TEMP TABLE n AS WITH RECURSIVE count(i) AS (SELECT 2 UNION ALL SELECT i + 1 FROM count WHERE i < 1000)"
      " SELECT i FROM count;"
      "INSERT INTO run SELECT i, robot_id, name, fluid, pump_profile, mean_flow_m_s, tube, operator_name, notes,"
      " verdict, firmware_version, controller_id, controller_checksum, parameters_checksum, started_at_us, ended_at_us,"
      " state, made_afterwards, made_by, profile FROM run, n WHERE run_id = 1;"
      "INSERT INTO run_span SELECT i, span, boot_key, first_seq, last_seq, NULL, NULL FROM run_span, n WHERE run_id = "
      "1;"
      "INSERT INTO run_certificate SELECT i, format, samples_expected, samples_live, samples_backfilled, samples_lost,"
      " lost_by_cause, longest_gap_samples, longest_gap_us, worst_clock_uncertainty_us, samples_without_clock, sha256,"
      " made_at_us, missed_ticks, longest_missed_ticks FROM run_certificate, n WHERE run_id = 1;"
      "DELETE FROM segment; DELETE FROM gap");
  storage::RunFilter filter;
  filter.limit = 1000;
  const std::vector<Run> runs = wait(runs_->list(filter));
  ASSERT_EQ(runs.size(), 1000u);
  for (const Run& run : runs) {
    ASSERT_EQ(run.samples_expected, 310u);
    ASSERT_EQ(run.samples_stored, 300u);
    ASSERT_EQ(run.samples_lost, 10u);
    ASSERT_EQ(run.spans.size(), 2u);
  }
}

TEST_F(RunDigestTest, CountsTheTicksThatTheRobotMissedApartFromWhatIsLost) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 20);
  robot_.late_us += 50'000;
  make(robot_, 20);
  robot_.late_us += 20'000;
  make(robot_, 20);
  EXPECT_EQ(wait(runs_->find(id))->missed, std::nullopt) << "counted with the digest";
  robot_.late_us += 70'000;
  reboot();  // what lies between two boots is no tick
  make(robot_, 20);
  end(id);
  const storage::MissedTicks expected{.count = 7, .longest = 5};
  const storage::RunDigest digest = final_digest(id);
  EXPECT_EQ(digest.missed, expected);
  EXPECT_EQ(digest.samples_lost, 0u);
  EXPECT_EQ(digest.longest_gap_us, 0);
  EXPECT_EQ(wait(runs_->find(id))->missed, expected);
}

// A version before this one did not count them. What the digest hashes is the same.
TEST_F(RunDigestTest, TheTicksOfAnOldDigestAreCountedAfterTheStart) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 20);
  robot_.late_us += 50'000;
  make(robot_, 20);
  end(id);
  const storage::RunDigest before = final_digest(id);
  ASSERT_EQ(before.missed, (storage::MissedTicks{.count = 5, .longest = 5}));
  stop();
  change("UPDATE run_certificate SET missed_ticks = NULL, longest_missed_ticks = NULL");
  start();
  clock_.run_for(1s);
  EXPECT_EQ(wait(runs_->find(id))->missed, before.missed);
  EXPECT_EQ(final_digest(id).sha256, before.sha256);
  EXPECT_EQ(final_digest(id).made_at_us, before.made_at_us);
  stop();
  change(
      "UPDATE run_certificate SET missed_ticks = NULL, longest_missed_ticks = NULL;"
      "DELETE FROM segment WHERE first_seq = (SELECT max(first_seq) FROM segment)");
  start();
  clock_.run_for(1s);
  EXPECT_EQ(wait(runs_->find(id))->missed, std::nullopt) << "not of a part of the samples";
}

TEST_F(RunDigestTest, WhereTheTicksOfAnOldDigestCannotBeReadTheStationGoesOn) {
  start();
  const storage::RunId id = make_eventful_run();
  final_digest(id);
  stop();
  change(
      "UPDATE run_certificate SET missed_ticks = NULL, longest_missed_ticks = NULL;"
      "ALTER TABLE run_span RENAME COLUMN last_seq TO last_one");
  start();
  clock_.run_for(1s);
  EXPECT_EQ(number("SELECT count(*) FROM run_certificate WHERE missed_ticks IS NULL"), 1);
  change("ALTER TABLE run_span RENAME COLUMN last_one TO last_seq");
  clock_.run_for(5s);
  robot_.boot_id += 1;
  robot_.next_seq = robot_.oldest_seq = 0;
  connect(robot_);
  const storage::RunId next = create();
  make(robot_, 20);
  end(next);
  EXPECT_EQ(final_digest(next).samples_live, 20u) << "its task has not ended";
}

TEST_F(RunDigestTest, ThereIsNoneOfAnOpenOrUnknownRun) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  EXPECT_EQ(wait(recording_->digester.find(id)).error().code, ErrorCode::conflict);
  EXPECT_EQ(wait(recording_->digester.find(99)).error().code, ErrorCode::not_found);
}

TEST_F(RunDigestTest, AnEmptyRunHasOne) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  end(id);
  const storage::RunDigest digest = final_digest(id);
  EXPECT_EQ(digest.samples_expected, 0u);
  EXPECT_EQ(digest.worst_clock_uncertainty_us, -1);
  EXPECT_EQ(digest.sha256, storage::SampleHash{storage::kDigestFormat}.text());
}

TEST_F(RunDigestTest, CountsSamplesThatHaveNoClock) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  station::SampleBatch batch = robot_.batch(0, 5);
  batch.clock_uncertainty_us = -1;
  send(robot_, batch);
  robot_.next_seq = 5;
  make(robot_, 5);
  end(id);
  EXPECT_EQ(final_digest(id).samples_without_clock, 5u);
}

TEST_F(RunDigestTest, IsTheSameAfterAVacuumAndWhenSegmentsAreCutDifferently) {
  start();
  const storage::RunId id = make_eventful_run();
  const storage::RunDigest before = final_digest(id);
  stop();
  // Each segment in two, the second half in rows of its own.
  change(
      "CREATE TEMP TABLE half AS SELECT rowid AS r, (last_seq - first_seq) / 2 + 1 AS n,"
      " (SELECT value FROM meta WHERE name = 'next_row') + sum(100) OVER (ORDER BY rowid) AS at"
      " FROM segment WHERE last_seq > first_seq;"
      "INSERT INTO sample SELECT half.at + row - first_row - n, position_m, velocity_m_s, acceleration_m_s2, duty,"
      " impedance_mv, reference_m FROM half JOIN segment ON segment.rowid = r JOIN sample"
      " ON row BETWEEN first_row + n AND last_row;"
      "CREATE TEMP TABLE second AS SELECT segment.*, n, at FROM half JOIN segment ON segment.rowid = r;"
      "UPDATE segment SET last_seq = first_seq + n - 1, last_row = first_row + n - 1 FROM half WHERE segment.rowid = r;"
      "UPDATE second SET first_seq = first_seq + n, first_robot_time_us = first_robot_time_us + n * period_us,"
      " first_row = at;"
      "UPDATE second SET last_row = first_row + last_seq - first_seq;"
      "ALTER TABLE second DROP COLUMN n; ALTER TABLE second DROP COLUMN at;"
      "INSERT INTO segment SELECT * FROM second;"
      "UPDATE meta SET value = (SELECT max(row) + 1 FROM sample) WHERE name = 'next_row'");
  change("VACUUM");
  change("DELETE FROM run_certificate");
  const auto segments = number("SELECT count(*) FROM segment");
  start();
  EXPECT_GT(segments, 8);
  EXPECT_TRUE(final_digest(id).agrees_with(before));
}

TEST_F(RunDigestTest, ARunLongerThanAPageIsCountedWhole) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  for (int i = 0; i < 45; ++i) {
    make(robot_, 1000, 25);
    flush();
  }
  end(id);
  EXPECT_EQ(final_digest(id).samples_live, 45'000u);
}

}  // namespace
}  // namespace server
