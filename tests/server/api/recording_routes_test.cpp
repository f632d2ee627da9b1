// The recording's health, its figures and backups through the routes.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class RecordingRoutesTest : public ApiTest {
 protected:
  void set_free_bytes(std::uint64_t bytes) {
    recording.disk_watch.set_free_bytes([bytes](const std::filesystem::path&) { return bytes; });
    clock.run_for(6s);
  }
  json backup(const std::string& name) {
    for (const json& listed : ask("GET", "/api/v1/backups").parsed()["backups"]) {
      if (listed["name"] == name) return listed;
    }
    return {};
  }
};

TEST_F(RecordingRoutesTest, ReportsWhatWasRecordedAndHowMuchRoomThereIs) {
  set_free_bytes(50'000'000'000);
  connect_robot();
  make_samples(*robot, 0, 20);
  clock.run_for(2s);
  const json health = ask("GET", "/api/v1/recording").parsed();
  EXPECT_EQ(health["state"], "recording");
  EXPECT_EQ(health["problem"], nullptr);
  EXPECT_EQ(health["space"], "ok");
  EXPECT_EQ(health["free_bytes"], 50'000'000'000);
  EXPECT_EQ(health["queued_samples"], 0);
  EXPECT_EQ(health["counters"]["samples_written"], 20);
  EXPECT_EQ(health["retention"]["retention_days"], 0);
  EXPECT_EQ(health["retention"]["event_retention_days"], 0);
  EXPECT_EQ(health["retention"]["events_purged"], 0);
  EXPECT_EQ(health["retention"]["all_held"], false);
}

TEST_F(RecordingRoutesTest, ALossIsReportedUntilAnAdminAcknowledgesIt) {
  EXPECT_EQ(ask("GET", "/api/v1/recording").parsed()["losses"], json::array());
  const auto database = folder.path() / "station.sqlite";
  storage::HeadFile head = **storage::load_head_file(database);
  head.head.commits += 1000;
  save_head_file(database, head);
  bool compared = false;
  const auto compare = [](storage::HeadWatch& watch, bool& done) -> boost::asio::awaitable<void> {
    co_await watch.open();
    done = true;
  };
  tasks.spawn("a start", compare(recording.head_watch, compared));
  ASSERT_TRUE(clock.run_until([&] { return compared; }, 10s));
  for (const char* document : {"/api/v1/recording", "/api/v1/station"}) {
    const json losses = ask("GET", document).parsed()["losses"];
    ASSERT_EQ(losses.size(), 1U) << document;
    EXPECT_THAT(losses[0]["problem"].get<std::string>(), HasSubstr("the database has lost commits"));
    EXPECT_EQ(losses[0]["noticed_at_us"], clock.utc_us());
  }
  EXPECT_THAT(ask("GET", "/metrics").body, HasSubstr("rheonaut_store_losses 1\n"));
  EXPECT_EQ(ask("GET", "/api/v1/recording").parsed()["state"], "recording");
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(ask("POST", "/api/v1/recording/losses/acknowledge").status, 403);
  scopes = identity::Scopes::of(identity::Role::admin);
  EXPECT_EQ(ask("POST", "/api/v1/recording/losses/acknowledge").status, 200);
  EXPECT_EQ(ask("GET", "/api/v1/station").parsed()["losses"], json::array());
  EXPECT_THAT(ask("GET", "/metrics").body, HasSubstr("rheonaut_store_losses 0\n"));
}

TEST_F(RecordingRoutesTest, WithoutRoomNoRunBeginsAndCommandsLive) {
  set_free_bytes(1'000'000);
  connect_robot();
  const json health = ask("GET", "/api/v1/recording").parsed();
  EXPECT_EQ(health["state"], "low_space");
  EXPECT_EQ(health["space"], "critical");
  EXPECT_THAT(health["problem"].get<std::string>(), HasSubstr("1 MB are free"));
  const Answered run = ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "no"}});
  EXPECT_EQ(run.status, 503);
  EXPECT_EQ(run.parsed()["reason"], "low_space");
  const Answered copy = ask("POST", "/api/v1/backups", {{"name", "no"}});
  EXPECT_EQ(copy.status, 503);
  EXPECT_EQ(copy.parsed()["reason"], "low_space");
  const auto stop = begin("POST", "/api/v1/robots/r1/emergency-stop");
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 99);
  EXPECT_EQ(end(stop).status, 200);

  set_free_bytes(50'000'000'000);
  EXPECT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "yes"}}).status, 201);
}

TEST_F(RecordingRoutesTest, ALockedDatabaseIsFailingUntilItIsFree) {
  set_free_bytes(50'000'000'000);
  connect_robot();
  SQLite::Database foreign{(folder.path() / "station.sqlite").string(), SQLite::OPEN_READWRITE};
  foreign.exec("BEGIN IMMEDIATE");
  make_samples(*robot, 0, 20);
  clock.run_for(2s);
  const json health = ask("GET", "/api/v1/recording").parsed();
  EXPECT_EQ(health["state"], "failing");
  EXPECT_THAT(health["problem"].get<std::string>(), HasSubstr("another program holds the file"));
  EXPECT_EQ(health["queued_samples"], 20);
  EXPECT_THAT(ask("GET", "/metrics").body, HasSubstr("\nrheonaut_recording_failing 1\n"));
  foreign.exec("ROLLBACK");
  clock.run_for(3s);
  EXPECT_EQ(ask("GET", "/api/v1/recording").parsed()["state"], "recording");
}

class ShortLogTest : public ApiTest {
 protected:
  ShortLogTest() : ApiTest{{}, {.path = {}, .enrolment = {}, .checkpoint_bytes = 1 << 17}} {}

  void record(microseconds duration) {
    for (microseconds passed{0}; passed < duration; passed += 100ms) {
      make_samples(*robot, next_seq_, 10);
      next_seq_ += 10;
      clock.run_for(100ms);
    }
  }
  double held_s() { return ask("GET", "/api/v1/recording").parsed()["wal_held_s"]; }
  std::string metrics() { return ask("GET", "/metrics").body; }

 private:
  std::uint64_t next_seq_ = 0;
};

TEST_F(ShortLogTest, ALogThatAForeignProgramHoldsIsReportedUntilItEnds) {
  connect_robot();
  record(5s);
  EXPECT_EQ(held_s(), 0);
  EXPECT_THAT(metrics(), HasSubstr("\nrheonaut_wal_held 0\n"));
  {
    SQLite::Database foreign{(folder.path() / "station.sqlite").string(), SQLite::OPEN_READONLY};
    foreign.exec("BEGIN");
    foreign.execAndGet("SELECT count(*) FROM robot").getInt();
    record(40s);  // with some checkpoints that wait a second for it, in real time
    EXPECT_GT(held_s(), 25);
    EXPECT_LT(held_s(), 40);
    EXPECT_THAT(metrics(), HasSubstr("\nrheonaut_wal_held 1\n"));
  }
  record(20s);
  EXPECT_EQ(held_s(), 0);
  EXPECT_THAT(metrics(), HasSubstr("\nrheonaut_wal_held 0\n"));
}

TEST_F(RecordingRoutesTest, MetricsAreTextWithHelpAndTypeAndNeedACredential) {
  connect_robot();
  make_samples(*robot, 0, 20);
  clock.run_for(2s);
  const Answered metrics = ask("GET", "/metrics");
  EXPECT_EQ(metrics.response.content_type, "text/plain; version=0.0.4");
  EXPECT_THAT(metrics.body, HasSubstr("# TYPE rheonaut_samples_written_total counter\n"
                                      "rheonaut_samples_written_total 20\n"));
  EXPECT_THAT(metrics.body, HasSubstr("# HELP rheonaut_free_bytes "));

  RawClient unauthenticated{clock, port()};
  unauthenticated.send("GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(unauthenticated.read_until("\r\n"), HasSubstr("401"));
}

TEST_F(RecordingRoutesTest, ABackupIsBegunListedAndDone) {
  set_free_bytes(50'000'000'000);
  connect_robot();
  make_samples(*robot, 0, 20);
  const Answered begun = ask("POST", "/api/v1/backups", {{"name", "monday"}});
  ASSERT_EQ(begun.status, 202) << begun.body;
  EXPECT_EQ(begun.parsed()["state"], "copying");
  EXPECT_TRUE(clock.run_until([&] { return !recording.backups.busy(); }, 60s));
  const json made = backup("monday");
  EXPECT_EQ(made["state"], "done") << made;
  EXPECT_EQ(made["problem"], nullptr);
  EXPECT_EQ(made["pages_done"], made["pages_total"]);
  EXPECT_TRUE(std::filesystem::exists(made["path"].get<std::string>()));
  EXPECT_EQ(ask("POST", "/api/v1/backups", {{"name", "monday"}}).status, 409);
  EXPECT_EQ(ask("POST", "/api/v1/backups", {{"name", "../monday"}}).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/backups", {{"path", "/tmp/x"}}).status, 400);
}

}  // namespace
}  // namespace server
