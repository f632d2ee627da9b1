// What is done leaves an entry in the chain, with what was done or not at all; and nobody can fill the disk with
// entries.
#include "server/storage/upkeep/audit_check.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "server/identity/account_store.hpp"
#include "server/storage/audit/audit_queries.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"
#include "tests/server/captured_log.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

station::AuditNote note(const std::string& action) {
  station::AuditNote made;
  made.by = {"user:anna/session:4", "192.168.1.7", 1'700'000'000'000'001};
  made.robot_id = "nemo";
  made.action = action;
  made.subject = "17";
  made.detail = R"({"kind":"zero_position"})";
  return made;
}

TEST(AuditHashes, AreWhatAnybodyComputesByTheDocument) {
  storage::AuditSalt salt{};
  for (std::size_t i = 0; i < salt.size(); ++i) salt[i] = static_cast<unsigned char>(i);
  const storage::AuditHash content = storage::content_hash_of(note("command.verified"), salt);
  // By Python's hashlib.blake2b(…, digest_size=32).
  EXPECT_EQ(storage::text(content), "738487ff008269b9d5fc5659c89fee96ae77c01d7f6069d9f9c65b9ec6adb591");
  EXPECT_EQ(storage::text(storage::link_hash_of(storage::AuditHash{}, 1, content)),
            "12d9bbeddd85ef8fccb54aa70a8521d475bc81f5331edcb665dc63ae84c2133c");
}

TEST(AuditHashes, BytesThatMoveFromOneColumnIntoTheNextChangeIt) {
  station::AuditNote one = note("command.sent");
  station::AuditNote other = one;
  one.by.actor = "ab";
  one.by.peer = "c";
  other.by.actor = "a";
  other.by.peer = "bc";
  EXPECT_NE(storage::content_hash_of(one, storage::AuditSalt{}), storage::content_hash_of(other, storage::AuditSalt{}));
}

TEST(AuditHeads, AreReadAsTheyAreWritten) {
  storage::AuditHead head{42, {}};
  head.hash[0] = 0xab;
  EXPECT_EQ(storage::parse_audit_head(text(head)), head);
  for (const char* bad : {"", "42", "42:", ":ab", "0:00", "x:00", "42:zz", "42:abcd"}) {
    EXPECT_FALSE(storage::parse_audit_head(bad)) << bad;
  }
  EXPECT_FALSE(storage::parse_audit_head(text(head) + "00"));
}

class AuditTest : public RecordingTest {
 protected:
  station::CommandRecord command(station::CommandId id, station::CommandState state = station::CommandState::queued) {
    station::CommandRecord made;
    made.id = id;
    made.robot_id = robot_.id;
    made.boot_id = robot_.boot_id;
    made.kind = "set_setpoint";
    made.arguments = R"({"setpoint_m":0.1})";
    made.actor = "user:anna/session:4";
    made.peer = "192.168.1.7";
    made.state = state;
    made.submitted_at_us = clock_.utc_us();
    return made;
  }
  void flush_records() { ASSERT_TRUE(wait(recorder_->flush_records())); }
  storage::AuditFindings findings(const std::optional<storage::AuditHead>& expected = {}) {
    SQLite::Database database = storage::open_for_reading(path_);
    return check_audit(database, expected);
  }
  std::vector<std::string> actions() { return rows("SELECT action FROM audit ORDER BY entry"); }
  storage::AuditPage page(const storage::AuditFilter& filter) {
    SQLite::Database database = storage::open_for_reading(path_);
    return read_audit(database, filter);
  }

  TestRobot robot_;
};

TEST_F(AuditTest, ACommandLeavesAnEntryForEachStateThatIsStored) {
  start();
  station::CommandRecord record = command(18446744073709551615U);
  recorder_->on_command(record);
  flush_records();
  record.state = station::CommandState::sent;
  record.sent_at_us = record.submitted_at_us + 2'000;
  record.sent_after_us = 2'000;
  recorder_->on_command(record);
  flush_records();
  record.state = station::CommandState::rejected;
  record.reason = "wrong_mode";
  record.ended_at_us = record.submitted_at_us + 5'000;
  recorder_->on_command(record);
  flush_records();
  EXPECT_THAT(actions(), ElementsAre("station.started", "command.queued", "command.sent", "command.rejected"));
  EXPECT_EQ(rows("SELECT DISTINCT actor, peer, robot_id, subject FROM audit WHERE entry > 1"),
            std::vector<std::string>{"user:anna/session:4|192.168.1.7|nemo|18446744073709551615"});
  const auto detail = nlohmann::json::parse(rows("SELECT detail FROM audit WHERE entry = 4").at(0));
  EXPECT_EQ(detail.at("arguments").at("setpoint_m"), 0.1);
  EXPECT_EQ(detail.at("reason"), "wrong_mode");
  EXPECT_EQ(detail.at("sent_after_us"), 2'000);
  EXPECT_EQ(number("SELECT at_us FROM audit WHERE entry = 4"), record.ended_at_us);
  EXPECT_EQ(number("SELECT audit_entry FROM command"), 4);
  const storage::AuditFindings found = findings();
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_EQ(found.entries, 4u);
  EXPECT_EQ(found.commands, 1u);
}

// SAFETY of the record: an entry without its row, or a row without its entry, would each be a lie.
TEST_F(AuditTest, ACommitThatFailsTakesItsEntriesWithIt) {
  start();
  recorder_->on_command(command(1));
  flush_records();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE, 5000};
  foreign.exec("CREATE TRIGGER full BEFORE INSERT ON command BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  recorder_->on_audit(note("control.taken"));
  recorder_->on_command(command(2));
  clock_.run_for(5s);
  EXPECT_TRUE(recorder_->failing());
  EXPECT_GE(recorder_->counters().commits_failed, 3u);
  EXPECT_EQ(actions().size(), 2u);
  EXPECT_THAT(findings().faults, IsEmpty());
  foreign.exec("DROP TRIGGER full");
  flush_records();
  EXPECT_THAT(actions(), ElementsAre("station.started", "command.queued", "control.taken", "command.queued"));
  EXPECT_THAT(findings().faults, IsEmpty());
}

TEST_F(AuditTest, AKillLeavesAWholeChainAndTheNextStartGoesOnWithIt) {
  start();
  station::CommandRecord stop_request = command(3, station::CommandState::sent);
  stop_request.kind = "emergency_stop";
  recorder_->on_command(stop_request);
  recorder_->on_command(command(4, station::CommandState::sent));
  flush_records();
  recorder_->on_audit(note("control.taken"));  // not committed
  kill();
  EXPECT_EQ(number("SELECT max(entry) FROM audit"), 3);
  start();
  ASSERT_EQ(restored_.pending_stops.size(), 1u);
  EXPECT_EQ(restored_.pending_stops.at(0).peer, "192.168.1.7");
  flush_records();
  EXPECT_THAT(actions(),
              ElementsAre("station.started", "command.sent", "command.sent", "command.unknown", "station.started"));
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE subject = '4' AND detail LIKE '%station_restarted%'"), 1);
  stop();
  EXPECT_EQ(actions().back(), "station.stopped");
  EXPECT_THAT(findings().faults, IsEmpty());
}

TEST_F(AuditTest, RunsRobotsAndAccountsAreInIt) {
  start();
  connect(robot_);
  make(robot_, 10);
  flush();
  const station::Author by{"token:ana", "10.0.0.9", 0};
  const storage::RunId run = wait(runs_->create(robot_.id, named("one"), by))->id;
  make(robot_, 10);
  ASSERT_TRUE(wait(runs_->end(run, "good", by)));
  storage::RunAnnotation annotation;
  annotation.texts["notes"] = "warm";
  ASSERT_TRUE(wait(runs_->annotate(run, annotation, by)));
  ASSERT_TRUE(wait(runs_->discard(run, "the pump was off", by)));
  ASSERT_TRUE(wait(runs_->create(robot_.id, named("open"), by)));
  auto accounts = [](storage::Database& database) {
    const station::Author who{"user:otto/session:1", "10.0.0.8", 7};
    identity::AccountStore store{database.handle()};
    const bool added = store.add_user({"anna", identity::Role::viewer, "", 7, who.actor, false}, who).has_value();
    const bool twice = store.add_user({"anna", identity::Role::viewer, "", 7, who.actor, false}, who).has_value();
    const bool revoked = store.revoke_robot("nemo", who).has_value() && store.revoke_robot("nemo", who).has_value();
    return added && !twice && revoked && !store.revoke_robot("nobody", who);
  };
  EXPECT_TRUE(wait(recorder_->on_disk(std::move(accounts))));
  stop();
  EXPECT_EQ(
      rows("SELECT action, actor, peer, robot_id, subject FROM audit WHERE action NOT LIKE 'station.%'"
           " ORDER BY entry"),
      (std::vector<std::string>{
          "robot.enrolled|loopback||nemo|", "run.made|token:ana|10.0.0.9|nemo|1", "run.ended|token:ana|10.0.0.9|nemo|1",
          "run.annotated|token:ana|10.0.0.9|nemo|1", "run.discarded|token:ana|10.0.0.9|nemo|1",
          "run.made|token:ana|10.0.0.9|nemo|2", "account.user_added|user:otto/session:1|10.0.0.8||anna",
          "robot.revoked|user:otto/session:1|10.0.0.8|nemo|", "run.interrupted|station||nemo|2"}));
  EXPECT_THAT(findings().faults, IsEmpty());
}

TEST_F(AuditTest, AFloodOfRefusalsIsCountedAndDoesNotFillTheDisk) {
  start();
  station::AuditNote refused = note("command.refused");
  refused.can_flood = true;
  for (int n = 0; n < 100; ++n) {
    for (int each = 0; each < 100; ++each) recorder_->on_audit(refused);
    clock_.run_for(100ms);
  }
  recorder_->on_audit(note("control.forced"));  // is not kept out by them
  clock_.run_for(11s);
  flush_records();
  const std::int64_t written = number("SELECT count(*) FROM audit WHERE action = 'command.refused'");
  EXPECT_GE(written, storage::AuditQuota::kBurst);
  EXPECT_LE(written, storage::AuditQuota::kBurst + 1);
  EXPECT_LE(number("SELECT count(*) FROM audit WHERE action = 'audit.left_out'"), 3);
  EXPECT_EQ(number("SELECT sum(detail ->> 'count') FROM audit WHERE action = 'audit.left_out'"
                   " AND subject = 'command.refused'"),
            10'000 - written);
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE action = 'control.forced'"), 1);
  clock_.run_for(60s);
  recorder_->on_audit(refused);
  flush_records();
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE action = 'command.refused'"), written + 1);
}

TEST_F(AuditTest, WhatTheFullQueueDoesNotTakeIsCountedToo) {
  storage::RecorderOptions options;
  options.max_queued_records = 10;
  start(options);
  for (int n = 0; n < 25; ++n) recorder_->on_audit(note("control.taken"));
  recorder_->on_command(command(5));
  station::CommandRecord stop_request = command(6);
  stop_request.kind = "emergency_stop";
  recorder_->on_command(stop_request);  // SAFETY: is recorded whatever waits
  stop();
  const std::int64_t written = number("SELECT count(*) FROM audit WHERE action = 'control.taken'");
  EXPECT_LE(written, 10);
  EXPECT_EQ(number("SELECT sum(detail ->> 'count') FROM audit WHERE action = 'audit.left_out'"), 25 - written + 1);
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE subject = '6'"), 1);
  EXPECT_THAT(findings().faults, IsEmpty());
}

TEST_F(AuditTest, TheTableRefusesToBeChangedByAccident) {
  start();
  flush_records();
  stop();
  SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE, 5000};
  const std::string columns = "at_us, actor, peer, robot_id, action, subject, detail, salt, content_hash, hash";
  for (const std::string& sql : {std::string{"UPDATE audit SET actor = 'nobody'"}, std::string{"DELETE FROM audit"},
                                 "INSERT INTO audit SELECT 99, " + columns + " FROM audit WHERE entry = 1",
                                 "INSERT OR REPLACE INTO audit SELECT 1, " + columns + " FROM audit WHERE entry = 2"}) {
    EXPECT_THROW(database.exec(sql), SQLite::Exception) << sql;
  }
  EXPECT_THAT(findings().faults, IsEmpty());
}

TEST_F(AuditTest, PagesAreFilteredAndGoOnWhereTheLastOneEnded) {
  start();
  for (int n = 0; n < 12'000; ++n) {
    station::AuditNote each = note(n % 4000 == 0 ? "control.taken" : "run.annotated");
    each.by.at_us = 1'000'000 + n;
    each.by.actor = n % 2 == 0 ? "even" : "odd";
    each.robot_id = n % 3000 == 0 ? "dory" : "nemo";
    recorder_->on_audit(each);
  }
  flush_records();
  std::vector<std::int64_t> found;
  int pages = 0;
  storage::AuditFilter filter;
  filter.action = "control";
  filter.limit = 2;
  do {
    const storage::AuditPage some = page(filter);
    for (const storage::AuditEntry& entry : some.entries) found.push_back(entry.note.by.at_us);
    filter.before = some.next;
    EXPECT_EQ(some.head.entry, 12'001);
    ++pages;
  } while (filter.before != 0 && pages < 20);
  EXPECT_THAT(found, ElementsAre(1'008'000, 1'004'000, 1'000'000));
  EXPECT_GT(pages, 2) << "a page looks at a bounded number of entries";
  storage::AuditFilter all;
  all.actor = "odd";
  all.from_us = 1'011'900;
  all.to_us = 1'011'910;
  EXPECT_EQ(page(all).entries.size(), 5u);
  all.to_us = 1'011'909;  // an entry is of this moment
  EXPECT_EQ(page(all).entries.size(), 4u);
  all.robot_id = "dory";
  EXPECT_THAT(page(all).entries, IsEmpty());
}

TEST_F(AuditTest, TheExportOfARunHoldsItsPartOfTheChainAndNobodyElsesDoings) {
  start();
  connect(robot_);
  station::AuditNote elsewhere = note("control.forced");
  elsewhere.robot_id = "dory";
  elsewhere.detail = R"({"secret":"of another robot"})";
  station::AuditNote account = note("account.signed_in");
  account.robot_id = "";
  account.by = {"user:very-secret/session:1", "10.9.8.7", 0};
  station::AuditNote refused = note("command.refused");
  refused.robot_id = "";
  refused.subject = "very-secret-name";
  const auto notify = [this](station::AuditNote each) {
    clock_.run_for(10ms);
    each.by.at_us = clock_.utc_us();
    recorder_->on_audit(each);
  };
  notify(note("control.taken"));
  clock_.run_for(10ms);
  const storage::RunId run = wait(runs_->create(robot_.id, named("exported")))->id;
  make(robot_, 10);
  clock_.run_for(10ms);
  recorder_->on_command(command(7));
  for (const station::AuditNote& each : {elsewhere, account, refused, note("control.released")}) notify(each);
  ASSERT_TRUE(wait(runs_->end(run, "")));
  notify(note("control.taken"));
  flush_records();
  const auto file = folder_ / "run.sqlite";
  {
    SQLite::Database database = storage::open_for_reading(path_);
    const storage::ExportQuery query{.run = run, .channels = storage::all_channels(), .grid_us = {}};
    storage::RunFile writer{file, storage::reading_uri(path_, false), storage::read_spans(database, run, 0), query};
    while (writer.advance(database)) continue;
  }
  SQLite::Database exported{file.string(), SQLite::OPEN_READWRITE};
  const storage::AuditFindings found = storage::check_exported_audit(exported, {});
  EXPECT_THAT(found.faults, IsEmpty());
  std::vector<std::string> shown;
  SQLite::Statement query{exported, "SELECT coalesce(action, '-') FROM audit ORDER BY entry"};
  while (query.executeStep()) shown.push_back(query.getColumn(0).getString());
  EXPECT_THAT(shown, ElementsAre("control.taken", "run.made", "-", "-", "-", "control.released", "command.queued",
                                 "run.ended"));
  EXPECT_EQ(found.hidden, 3u);
  std::ifstream in{file, std::ios::binary};
  const std::string bytes{std::istreambuf_iterator<char>{in}, {}};
  for (const char* secret : {"very-secret", "of another robot", "10.9.8.7"}) {
    EXPECT_EQ(bytes.find(secret), std::string::npos) << secret;
  }
  // It is the station's own chain.
  EXPECT_THAT(findings(found.head).faults, IsEmpty());
  const auto hidden = exported.execAndGet("SELECT min(entry) FROM audit WHERE action IS NULL").getInt64();
  exported.exec(fmt::format("UPDATE audit SET content_hash = zeroblob(32) WHERE entry = {}", hidden));
  EXPECT_THAT(storage::check_exported_audit(exported, {}).faults,
              ElementsAre(HasSubstr(fmt::format("entry {} does not follow on", hidden))));
  exported.exec(fmt::format("UPDATE audit SET actor = 'x' WHERE entry = {}", hidden));
  EXPECT_THAT(storage::check_exported_audit(exported, {}).faults, ElementsAre(HasSubstr("was changed")));
}

TEST_F(AuditTest, AClockBehindWhatWasRecordedLastIsSaidAtTheStart) {
  start();
  ASSERT_TRUE(wait(recorder_->flush_records()));
  stop();
  {
    const CapturedLog log;
    start();
    EXPECT_FALSE(log.has("behind what was recorded last"));
    ASSERT_TRUE(wait(recorder_->flush_records()));
    stop();
  }
  clock_.step_utc(-std::chrono::hours{48});
  const CapturedLog log;
  start();
  EXPECT_TRUE(log.has("is 172")) << log.text();
  EXPECT_TRUE(log.has("s behind what was recorded last")) << log.text();
}

}  // namespace
}  // namespace server
