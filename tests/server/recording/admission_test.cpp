// Who may connect, and with which boot.
#include <gmock/gmock.h>

#include <boost/asio/experimental/awaitable_operators.hpp>

#include "server/identity/account_store.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

using ::testing::HasSubstr;

class AdmissionTest : public RecordingTest {
 protected:
  TestRobot robot_;

  static TestRobot numbered(int number) {
    TestRobot robot;
    robot.id = "r" + std::to_string(number);
    robot.boot_id = 1000 + static_cast<station::BootId>(number);
    return robot;
  }
  // Of robots 1 to count, which ask one after the other.
  int enrolled_of(int count) {
    int enrolled = 0;
    for (int i = 1; i <= count; ++i) enrolled += admit(numbered(i)).newly_enrolled ? 1 : 0;
    return enrolled;
  }

  // From elsewhere than loopback.
  station::Admission admit_remote(const std::string& token) {
    TestRobot remote = robot_;
    remote.from_loopback = false;
    remote.token = token;
    return admit(remote);
  }
};

TEST_F(AdmissionTest, FollowsTheTable) {
  struct Case {
    const char* enrolled_with;  // null: the robot is unknown
    const char* token;
    bool from_loopback;
    bool enrol_on_loopback;
    protocol::RefusalReason expected;
    bool newly_enrolled;
  };
  constexpr auto kNone = rheonaut_REFUSAL_REASON_NONE;
  constexpr auto kWrongToken = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  constexpr auto kUnknownRobot = rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT;
  const std::vector<Case> table{
      {nullptr, "", true, true, kNone, true},
      {nullptr, "secret", true, true, kNone, true},
      {nullptr, "secret", true, false, kUnknownRobot, false},
      {nullptr, "", true, false, kUnknownRobot, false},
      {nullptr, "secret", false, true, kUnknownRobot, false},
      {nullptr, "", false, true, kWrongToken, false},
      {"", "", true, true, kNone, false},
      {"", "", true, false, kNone, false},
      {"", "", false, true, kWrongToken, false},
      {"", "secret", true, true, kNone, true},  // brings a token from now on
      {"", "secret", true, false, kWrongToken, false},
      {"", "secret", false, true, kWrongToken, false},
      {"secret", "secret", true, true, kNone, false},
      {"secret", "secret", false, false, kNone, false},
      {"secret", "other", true, true, kWrongToken, false},
      {"secret", "other", false, true, kWrongToken, false},
      {"secret", "", true, true, kWrongToken, false},
      {"secret", "", false, true, kWrongToken, false},
  };
  int number = 0;
  for (const Case& entry : table) {
    SCOPED_TRACE(number++);
    std::filesystem::remove(path_);
    TestRobot robot;
    if (entry.enrolled_with != nullptr) {
      start();
      robot.token = entry.enrolled_with;
      ASSERT_TRUE(admit(robot).newly_enrolled);
      stop();
    }
    storage::RecorderOptions options;
    options.enrolment.allowed = entry.enrol_on_loopback;
    start(options);
    robot.token = entry.token;
    robot.from_loopback = entry.from_loopback;
    robot.boot_id = 77;
    const station::Admission admission = admit(robot);
    EXPECT_EQ(admission.refusal, entry.expected) << admission.detail;
    EXPECT_EQ(admission.newly_enrolled, entry.newly_enrolled);
    EXPECT_EQ(admission.detail.empty(), entry.expected == kNone);
    stop();
  }
}

TEST_F(AdmissionTest, TheTokenIsStoredAsAHashOnly) {
  start();
  robot_.token = "a token of 256 random bits";
  admit(robot_);
  EXPECT_EQ(number("SELECT length(token_hash) FROM robot"), 32);
  EXPECT_EQ(number("SELECT instr(token_hash, 'random') FROM robot"), 0);
}

TEST_F(AdmissionTest, ANewRobotsTokenIsNeededFromElsewhere) {
  start();
  robot_.token = "secret";
  EXPECT_TRUE(admit(robot_).newly_enrolled);
  EXPECT_EQ(admit_remote("secret").refusal, rheonaut_REFUSAL_REASON_NONE);
  EXPECT_EQ(admit_remote("guess").refusal, rheonaut_REFUSAL_REASON_WRONG_TOKEN);
}

TEST_F(AdmissionTest, ARevokedRobotIsRefusedUntilItIsEnrolledAgain) {
  start();
  robot_.token = "secret";
  admit(robot_);
  const auto with_store = [this](auto change) {
    auto job = [change](storage::Database& database) {
      identity::AccountStore store{database.handle()};
      return change(store);
    };
    return wait(recorder_->on_disk(std::move(job)));
  };
  ASSERT_TRUE(
      with_store([id = robot_.id](identity::AccountStore& store) { return store.revoke_robot(id, {"anna", "", 1}); }));
  stop();
  start();  // from loopback, where robots that are not known are enrolled
  for (const char* token : {"secret", "", "another"}) {
    robot_.token = token;
    const station::Admission refused = admit(robot_);
    EXPECT_EQ(refused.refusal, rheonaut_REFUSAL_REASON_WRONG_TOKEN) << token;
    EXPECT_NE(refused.detail.find("was revoked"), std::string::npos) << refused.detail;
  }
  const auto enrol = [id = robot_.id](identity::AccountStore& store) {
    return store.enrol(id, runtime::hash_of("new"), {"anna", "", 2});
  };
  ASSERT_TRUE(with_store(enrol));
  robot_.token = "secret";
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_WRONG_TOKEN);
  robot_.token = "new";
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_NONE);
  EXPECT_EQ(rows("SELECT enrolled_by, revoked_at_us FROM robot"), std::vector<std::string>{"anna|"});
}

TEST_F(AdmissionTest, ARobotThatIsRevokedWhileItIsAdmittedIsRefused) {
  start();
  admit(robot_);
  const auto revoke = [](storage::Recorder& recorder, station::RobotId id) -> asio::awaitable<bool> {
    recorder.set_revoked(id, true);
    co_return true;
  };
  // The lambda outlives its coroutine. NOLINTNEXTLINE(cppcoreguidelines-avoid-capturing-lambda-coroutines)
  const auto admit_and_revoke = [&revoke](storage::Recorder& recorder,
                                          station::AdmissionRequest hello) -> asio::awaitable<station::Admission> {
    const station::RobotId id = hello.robot_id;
    const auto both = co_await (recorder.admit(std::move(hello)) && revoke(recorder, id));  // the disk is asked first
    co_return std::get<0>(both);
  };
  const station::Admission late = wait(admit_and_revoke(*recorder_, hello_of(robot_)));
  EXPECT_EQ(late.refusal, rheonaut_REFUSAL_REASON_WRONG_TOKEN);
  recorder_->set_revoked(robot_.id, false);
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_NONE);
}

TEST_F(AdmissionTest, SendsTheStoreAndWhatIsDurable) {
  start();
  connect(robot_);
  make(robot_, 20);
  flush();
  const station::Admission again = admit(robot_);
  EXPECT_EQ(again.durable_next_seq, 20u);
  EXPECT_NE(again.store_id, 0u);
}

TEST_F(AdmissionTest, ANewBootIsKnownBeforeItIsStored) {
  start();
  connect(robot_);
  EXPECT_EQ(number("SELECT count(*) FROM boot"), 0);
  const station::Admission again = admit(robot_);
  EXPECT_EQ(again.refusal, rheonaut_REFUSAL_REASON_NONE) << again.detail;
  TestRobot other;
  other.id = "dory";
  EXPECT_EQ(admit(other).refusal, rheonaut_REFUSAL_REASON_BOOT_ID_REUSED);
  make(robot_, 10);
  flush();
  EXPECT_EQ(rows("SELECT boot_key, robot_id, durable_next_seq FROM boot"), std::vector<std::string>{"1|nemo|10"});
}

TEST_F(AdmissionTest, ADiskThatFailsStillAdmitsEnrolledRobots) {
  start();
  connect(robot_);
  flush();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
  foreign.exec("CREATE TRIGGER full BEFORE INSERT ON boot BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  TestRobot rebooted;
  rebooted.boot_id = 77;
  TestRobot unused;
  unused.boot_id = 78;
  EXPECT_EQ(admit(unused).refusal, rheonaut_REFUSAL_REASON_NONE);
  connect(rebooted);
  make(rebooted, 100);
  clock_.run_for(100s);  // `unused` never connects, and is not forgotten before it is stored
  ASSERT_TRUE(recorder_->failing());
  EXPECT_EQ(admit(unused).refusal, rheonaut_REFUSAL_REASON_NONE);
  foreign.exec("DROP TRIGGER full");
  flush();
  EXPECT_EQ(rows("SELECT boot_id, durable_next_seq FROM boot ORDER BY boot_key DESC LIMIT 2"),
            (std::vector<std::string>{"77|100", "78|0"}));
  EXPECT_EQ(number("SELECT value FROM meta WHERE name = 'next_boot_key'"), 4);
}

// A robot that reboots again and again while the disk fails does not fill the memory.
TEST_F(AdmissionTest, NewBootsThatWaitForTheDiskAreBounded) {
  storage::RecorderOptions options;
  options.max_queued_records = 5;
  start(options);
  connect(robot_);
  flush();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
  foreign.exec("CREATE TRIGGER full BEFORE INSERT ON boot BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  TestRobot rebooted;
  int admitted = 0;
  for (rebooted.boot_id = 100; rebooted.boot_id < 150; ++rebooted.boot_id) {
    const station::Admission admission = admit(rebooted);
    admitted += admission.refusal == rheonaut_REFUSAL_REASON_NONE;
    if (rebooted.boot_id == 100) clock_.run_for(2s);  // that one is in the commit that fails
    if (rebooted.boot_id == 149) EXPECT_EQ(admission.refusal, rheonaut_REFUSAL_REASON_STATION_BUSY);
  }
  EXPECT_EQ(admitted, 6);
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_NONE) << "a boot that is known";
  foreign.exec("DROP TRIGGER full");
  clock_.run_for(3s);
  EXPECT_EQ(admit(rebooted).refusal, rheonaut_REFUSAL_REASON_NONE);
  flush();
  EXPECT_EQ(number("SELECT count(*) FROM boot"), 8);
}

TEST_F(AdmissionTest, ManyBootsShareACommit) {
  constexpr int kRobots = 200;
  start();
  auto enrol = [](storage::Database& database) {
    SQLite::Transaction transaction{database.handle()};
    database.handle().exec(
        "WITH RECURSIVE number(n) AS (VALUES (0) UNION ALL SELECT n + 1 FROM number WHERE n < 199)"
        " INSERT INTO robot (robot_id, enrolled_at_us) SELECT 'r' || n, 1 FROM number");
    transaction.commit();
  };
  wait(recorder_->on_disk(std::move(enrol)));
  const std::uint64_t commits = recorder_->counters().commits;
  for (int n = 0; n < kRobots; ++n) {
    TestRobot robot;
    robot.id = "r" + std::to_string(n);
    robot.boot_id = 1000 + static_cast<station::BootId>(n);
    connect(robot);
  }
  clock_.run_for(200ms);
  EXPECT_LE(recorder_->counters().commits, commits + 2);
  EXPECT_EQ(number("SELECT count(*) FROM boot WHERE connected_at_us IS NOT NULL"), kRobots);
}

// Another store acknowledged them, or this one before it lost them; what came after was overwritten in the ring.
TEST_F(AdmissionTest, WhatARobotNoLongerHasIsDistinguished) {
  start();
  robot_.next_seq = 900;
  robot_.oldest_seq = 150;
  robot_.acknowledged_next_seq = 100;
  robot_.next_event_seq = 20;
  robot_.oldest_event_seq = 8;
  robot_.acknowledged_next_event_seq = 8;
  connect(robot_);
  TestRobot silent;  // an older firmware
  silent.id = "dory";
  silent.boot_id = 7;
  silent.next_seq = 900;
  silent.oldest_seq = 150;
  connect(silent);
  flush();
  using GapRows = std::vector<std::string>;
  EXPECT_EQ(rows("SELECT robot_id, first_seq, last_seq, cause FROM robot_gap ORDER BY robot_id DESC, first_seq"),
            (GapRows{"nemo|0|99|acknowledged_earlier", "nemo|100|149|ring_overrun", "dory|0|149|ring_overrun"}));
  EXPECT_EQ(rows("SELECT first_event_seq, last_event_seq, cause FROM event_gap"), GapRows{"0|7|acknowledged_earlier"});
}

TEST_F(AdmissionTest, WhatThisStoreHoldsIsNoGapHoweverFarItWasAcknowledged) {
  start();
  connect(robot_);
  make(robot_, 500);
  flush();
  disconnect(robot_);
  robot_.acknowledged_next_seq = robot_.oldest_seq = 500;
  robot_.acknowledged_next_event_seq = ~0ULL;  // nonsense
  connect(robot_);
  make(robot_, 100);
  flush();
  EXPECT_EQ(number("SELECT count(*) FROM gap"), 0);
  EXPECT_EQ(number("SELECT count(*) FROM event_gap"), 0);
}

TEST_F(AdmissionTest, OnlySoManyRobotsEnrolThemselvesAMinute) {
  most_a_minute_ = 3;
  start();
  EXPECT_EQ(enrolled_of(5), 3);
  clock_.run_for(59s);
  const station::Admission refused = admit(numbered(4));
  EXPECT_EQ(refused.refusal, rheonaut_REFUSAL_REASON_STATION_BUSY);
  EXPECT_TRUE(refused.enrolment_full);
  EXPECT_THAT(refused.detail, HasSubstr("only 3 robots of this machine enrol themselves a minute: try again later"));
  EXPECT_EQ(admit(numbered(2)).refusal, rheonaut_REFUSAL_REASON_NONE) << "one that is enrolled";
  kill();
  start();
  EXPECT_EQ(admit(numbered(4)).refusal, rheonaut_REFUSAL_REASON_STATION_BUSY) << "a restart begins no new minute";
  clock_.run_for(2s);
  EXPECT_TRUE(admit(numbered(4)).newly_enrolled);
}

TEST_F(AdmissionTest, OnlySoManyRobotsEnrolThemselvesAtAll) {
  most_robots_ = 64;
  start();
  EXPECT_EQ(enrolled_of(70), 64);
  const station::Admission refused = admit(numbered(65));
  EXPECT_EQ(refused.refusal, rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT);
  EXPECT_TRUE(refused.enrolment_full);
  EXPECT_THAT(refused.detail, HasSubstr("only 64 robots of this machine enrol themselves: rheonaut robot enrol r65"));
  EXPECT_EQ(number("SELECT count(*) FROM robot"), 64);
  const auto with_store = [this](auto change) {
    auto job = [change](storage::Database& database) {
      identity::AccountStore store{database.handle()};
      return change(store);
    };
    return wait(recorder_->on_disk(std::move(job)));
  };
  ASSERT_TRUE(with_store(
      [](identity::AccountStore& store) { return store.enrol("r65", runtime::hash_of("a token"), {"anna", "", 1}); }));
  TestRobot with_token = numbered(65);
  with_token.token = "a token";
  EXPECT_EQ(admit(with_token).refusal, rheonaut_REFUSAL_REASON_NONE) << "people enrol as many as they like";
  ASSERT_TRUE(with_store([](identity::AccountStore& store) { return store.revoke_robot("r1", {"anna", "", 1}); }));
  EXPECT_TRUE(admit(numbered(66)).newly_enrolled) << "there is room again";
  EXPECT_FALSE(admit(numbered(67)).newly_enrolled);
}

TEST_F(AdmissionTest, ARestartKnowsTheFluidOfARobot) {
  start();
  connect(robot_);
  station::RobotState state = state_of(robot_, station::LinkState::connected);
  for (const char* fluid : {"water", "non_newtonian"}) {
    state.fluid = fluid;
    recorder_->on_fluid(state);
  }
  EXPECT_TRUE(wait(recorder_->flush_records()));
  kill();
  start();
  ASSERT_EQ(restored_.robots.size(), 1u);
  EXPECT_EQ(restored_.robots[0].fluid, "non_newtonian") << "the latest";
  state.fluid = "";
  recorder_->on_fluid(state);
  stop();
  start();
  EXPECT_EQ(restored_.robots.at(0).fluid, "");
}

}  // namespace
}  // namespace server
