// Users, tokens and enrolments: what is kept, what a restart finds, and what a disk that cannot be written spoils.
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <future>

#include "server/identity/accounts.hpp"
#include "server/storage/database/database.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class AccountsTest : public ApiTest {
 protected:
  int make_user(const std::string& name, const std::string& role = "operator") {
    return ask("POST", "/api/v1/users", {{"name", name}, {"role", role}, {"password", "correct horse"}}).status;
  }
  json make_token(const std::string& name, const std::string& of = "read,stop") {
    return ask("POST", "/api/v1/tokens", {{"name", name}, {"scopes", of}}).parsed();
  }
  // As after a restart.
  identity::Accounts stored() {
    return identity::Accounts{loop, clock, recorder, recording.removal_clock, folder.path()};
  }
  std::string everything_on_disk() const {
    std::string all;
    for (const char* name : {"station.sqlite", "station.sqlite-wal"}) {
      std::ifstream in{folder.path() / name, std::ios::binary};
      all.append(std::istreambuf_iterator<char>{in}, {});
    }
    return all;
  }
};

TEST_F(AccountsTest, UsersAreAddedListedChangedAndRemoved) {
  EXPECT_EQ(make_user("anna"), 201);
  EXPECT_EQ(make_user("anna"), 409);
  for (const char* name : {"", "Anna", "an na", "a/b", "12345678901234567890123456789012"}) {
    EXPECT_EQ(make_user(name), 422) << name;
  }
  EXPECT_EQ(make_user("otto", "boss"), 422);
  EXPECT_EQ(ask("POST", "/api/v1/users", {{"name", "o"}, {"role", "viewer"}, {"password", "short"}}).status, 422);
  const json users = ask("GET", "/api/v1/users").parsed()["users"];
  ASSERT_EQ(users.size(), 1U);
  EXPECT_EQ(users[0]["role"], "operator");
  EXPECT_EQ(users[0]["made_by"], "token:local");
  EXPECT_FALSE(users[0].contains("password_hash"));
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/change", {{"role", "admin"}}).parsed()["role"], "admin");
  EXPECT_EQ(ask("POST", "/api/v1/users/nobody/change", {{"role", "admin"}}).status, 404);
  EXPECT_EQ(stored().users().at("anna").role, identity::Role::admin);
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/remove").status, 200);
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/remove").status, 404);
  EXPECT_TRUE(stored().users().empty());
}

TEST_F(AccountsTest, ThereAreAtMostAHundredUsers) {
  for (std::size_t i = 0; i < identity::kMaxUsers; ++i) ASSERT_EQ(make_user("user" + std::to_string(i)), 201);
  EXPECT_EQ(make_user("one-more"), 409);
}

TEST_F(AccountsTest, ATokenIsShownOnceAndStoredAsAHash) {
  const json made = make_token("logger");
  const std::string secret = made["secret"];
  EXPECT_TRUE(runtime::is_secret(secret));
  const Answered list = ask("GET", "/api/v1/tokens");
  EXPECT_EQ(list.body.find(secret), std::string::npos);
  EXPECT_EQ(list.parsed()["tokens"][0]["scopes"], "read,stop");
  EXPECT_EQ(list.parsed()["tokens"][0]["last_used_at_us"], nullptr);
  EXPECT_EQ(everything_on_disk().find(secret), std::string::npos);
  EXPECT_NE(everything_on_disk().find("logger"), std::string::npos);

  identity::Accounts restarted = stored();
  EXPECT_EQ(restarted.caller_of_token(secret)->actor, "token:logger");
  EXPECT_EQ(accounts().caller_of_token(secret)->actor, "token:logger");
  clock.run_for(2min);
  EXPECT_EQ(stored().tokens().at(0).last_used_at_us / 60'000'000, (clock.utc_us() - 120'000'000) / 60'000'000);
  EXPECT_EQ(ask("POST", "/api/v1/tokens/logger/revoke").status, 200);
  EXPECT_FALSE(accounts().caller_of_token(secret));
  EXPECT_FALSE(stored().caller_of_token(secret));
  EXPECT_EQ(ask("POST", "/api/v1/tokens/nothing/revoke").status, 404);
  EXPECT_EQ(make_token("logger")["status"], 409) << "the record of commands names it";
  EXPECT_EQ(make_token("local")["status"], 422);
  EXPECT_EQ(make_token("other", "root")["status"], 422);
}

class ExpiredTokenTest : public AccountsTest {
 protected:
  ExpiredTokenTest() { clock.settle(); }
  bool holds() { return accounts().caller_of_token(secret).has_value(); }
  Answered revive() { return ask("POST", "/api/v1/tokens/logger/revive"); }
  json listed() { return ask("GET", "/api/v1/tokens").parsed()["tokens"][0]; }
  std::ptrdiff_t audited(const std::string& action) {
    const json entries = ask("GET", "/api/v1/audit").parsed()["entries"];
    return std::ranges::count_if(entries, [&action](const json& entry) { return entry["action"] == action; });
  }
  void let_expire(microseconds jump) {
    clock.step_utc(jump);
    clock.run_for(2s);
  }

  std::string secret =
      ask("POST", "/api/v1/tokens", {{"name", "logger"}, {"scopes", "read"}, {"days", 5}}).parsed()["secret"];
};

// SAFETY: an old credential.
TEST_F(ExpiredTokenTest, StaysRefusedWhenTheClockGoesBackUntilItIsRevived) {
  EXPECT_TRUE(holds());
  let_expire(192h);
  EXPECT_FALSE(holds());
  EXPECT_EQ(revive().parsed()["reason"], "token_has_ended") << "the clock says that it has expired";
  clock.step_utc(-192h);
  clock.run_for(2s);
  EXPECT_FALSE(holds());
  EXPECT_FALSE(stored().caller_of_token(secret)) << "and after a restart";
  EXPECT_NE(listed()["expired_at_us"], nullptr);
  EXPECT_EQ(revive().status, 200);
  EXPECT_TRUE(holds());
  EXPECT_TRUE(stored().caller_of_token(secret));
  EXPECT_EQ(listed()["expired_at_us"], nullptr);
  EXPECT_EQ(ask("POST", "/api/v1/tokens/nothing/revive").status, 404);
  EXPECT_EQ(ask("POST", "/api/v1/tokens/logger/revoke").status, 200);
  EXPECT_EQ(revive().status, 409);
  EXPECT_FALSE(holds());
}

TEST_F(ExpiredTokenTest, ThatHasNotExpiredIsNotRevivedAndNotAudited) {
  const Answered answer = revive();
  EXPECT_EQ(answer.status, 409);
  EXPECT_EQ(answer.parsed()["reason"], "token_not_expired");
  EXPECT_THAT(answer.parsed()["detail"].get<std::string>(), ::testing::HasSubstr("nothing was changed"));
  EXPECT_EQ(audited("account.token_revived"), 0);
  EXPECT_TRUE(holds());
}

TEST_F(ExpiredTokenTest, IsAuditedAsExpiredBeforeItIsRevived) {
  clock.step_utc(192h);
  EXPECT_FALSE(holds());
  clock.step_utc(-192h);  // before the disk has heard of it
  EXPECT_EQ(revive().status, 200);
  EXPECT_TRUE(holds());
  clock.run_for(2min);
  EXPECT_EQ(audited("account.token_expired"), 1);
  EXPECT_EQ(audited("account.token_revived"), 1);
  EXPECT_TRUE(stored().caller_of_token(secret));
}

TEST_F(ExpiredTokenTest, EndsForGoodWhenTheClockHasStoodByItForADay) {
  const auto run = [this](int hours) {
    for (int looks = 0; looks < hours * 12; ++looks) {
      clock.skip(5min);
      recording.removal_clock.look();
    }
    clock.run_for(2min);
  };
  let_expire(192h);
  run(23);
  EXPECT_EQ(listed()["revoked_at_us"], nullptr);
  run(2);
  EXPECT_NE(listed()["revoked_at_us"], nullptr);
  clock.step_utc(-192h);
  EXPECT_EQ(revive().status, 409);
  EXPECT_FALSE(holds());
  EXPECT_FALSE(stored().caller_of_token(secret));
}

TEST_F(ExpiredTokenTest, IsRefusedForeverByWhoWasRefusedOnce) {
  clock.step_utc(192h);
  EXPECT_FALSE(holds());
  clock.step_utc(-192h);  // before anybody else has looked
  EXPECT_FALSE(holds());
}

TEST_F(ExpiredTokenTest, IsNotRevivedThatTheDiskCouldNotEnd) {
  let_expire(192h);
  recording.removal_clock.accept();
  {
    const SQLite::Database lock = lock_disk();
    clock.run_for(2min);
    EXPECT_EQ(listed()["revoked_at_us"], nullptr) << "the disk fails";
  }
  clock.run_for(2min);
  EXPECT_NE(listed()["revoked_at_us"], nullptr);
  EXPECT_FALSE(stored().caller_of_token(secret));
  clock.step_utc(-192h);
  EXPECT_EQ(revive().status, 409);
}

TEST_F(ExpiredTokenTest, ThatWasRevokedOnlyInMemoryIsNotRevived) {
  {
    const SQLite::Database lock = lock_disk();
    EXPECT_EQ(ask("POST", "/api/v1/tokens/logger/revoke").status, 503);
  }
  EXPECT_EQ(revive().status, 409);
  EXPECT_FALSE(holds());
}

TEST_F(ExpiredTokenTest, IsKeptAsSuchByADiskThatFailedAWhile) {
  {
    const SQLite::Database lock = lock_disk();
    let_expire(192h);
    EXPECT_TRUE(stored().tokens().at(0).expired_at_us == 0) << "not stored yet";
  }
  clock.run_for(6s);
  EXPECT_NE(stored().tokens().at(0).expired_at_us, 0);
}

// SAFETY: what a disk that cannot be written must not do.
TEST_F(AccountsTest, AFailingDiskSignsNobodyOutAndNobodyIn) {
  connect_robot();
  ASSERT_EQ(make_user("anna"), 201);
  const std::string token_secret = make_token("button", "stop")["secret"];
  const std::string before = accounts().open_session("", "", "");
  clock.settle();
  {
    const SQLite::Database lock = lock_disk();
    const json credentials{{"user", "anna"}, {"password", "correct horse"}};
    EXPECT_EQ(ask("POST", "/api/v1/login", credentials).status, 200) << "kept in memory until it can be stored";
    EXPECT_TRUE(accounts().caller_of_session(before));
    EXPECT_TRUE(accounts().caller_of_token(token_secret));
    auto stopping = begin("POST", "/api/v1/robots/r1/emergency-stop");
    ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 1s));
    robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
    EXPECT_EQ(end(stopping).status, 200);
    // What gives rights is not in force unless it is stored; what takes them away is, at once.
    const Answered refused = ask("POST", "/api/v1/tokens", {{"name", "new"}, {"scopes", "admin"}});
    EXPECT_EQ(refused.status, 503);
    EXPECT_EQ(refused.parsed()["reason"], "not_stored");
    EXPECT_EQ(accounts().tokens().size(), 1U);
    const Answered revoked = ask("POST", "/api/v1/tokens/button/revoke");
    EXPECT_EQ(revoked.status, 503);
    EXPECT_NE(revoked.body.find("It is in force"), std::string::npos) << revoked.body;
    EXPECT_FALSE(accounts().caller_of_token(token_secret));
    EXPECT_EQ(stored().sessions().size(), 1U);
    const std::string ended = "/api/v1/sessions/" + std::to_string(accounts().sessions().front().number) + "/revoke";
    const Answered session_ended = ask("POST", ended);
    EXPECT_EQ(session_ended.status, 503);
    EXPECT_EQ(session_ended.parsed()["reason"], "not_stored");
    EXPECT_EQ(ask("POST", ended).status, 404) << "it has ended";
    EXPECT_EQ(stored().sessions().size(), 1U);
  }
  clock.run_for(6s);
  ASSERT_EQ(stored().sessions().size(), 1U) << "stored as soon as it can be";
  EXPECT_EQ(stored().sessions().front().user, "anna");
}

TEST_F(AccountsTest, AUserWhoIsRemovedWhileAChangeWaitsForTheDiskDoesNotComeBack) {
  ASSERT_EQ(make_user("anna"), 201);
  std::promise<void> gate;
  const std::shared_future<void> opened = gate.get_future().share();
  const auto wait = [&]() -> boost::asio::awaitable<void> {
    auto job = [opened](storage::Database&) { opened.wait(); };
    co_await recorder.on_disk(std::move(job));
  };
  const station::Author by;
  identity::UserChange to_admin;
  to_admin.role = identity::Role::admin;
  const auto change = [&]() -> boost::asio::awaitable<void> {
    EXPECT_TRUE(co_await accounts().change_user("anna", to_admin, by));
  };
  const auto remove = [&]() -> boost::asio::awaitable<void> {
    EXPECT_TRUE(co_await accounts().remove_user("anna", by));
  };
  tasks.spawn("work before it", wait());
  tasks.spawn("a change", change());
  tasks.spawn("a removal", remove());
  loop.restart();
  loop.poll();
  EXPECT_TRUE(accounts().users().empty()) << "at once";
  gate.set_value();
  clock.settle();
  EXPECT_TRUE(accounts().users().empty());
  EXPECT_TRUE(stored().users().empty());
}

TEST_F(AccountsTest, ARobotIsEnrolledRevokedAndEnrolledAgain) {
  const Answered made = ask("POST", "/api/v1/enrolments", {{"robot_id", "rheo-1"}});
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_TRUE(runtime::is_secret(made.parsed()["secret"]));
  EXPECT_EQ(made.parsed()["enrolled_by"], "token:local");
  EXPECT_EQ(ask("POST", "/api/v1/enrolments", {{"robot_id", "rheo-1"}}).status, 409);
  EXPECT_EQ(ask("POST", "/api/v1/enrolments", {{"robot_id", "Rheo 1"}}).status, 422);
  EXPECT_EQ(ask("GET", "/api/v1/enrolments").parsed()["enrolments"][0]["has_token"], true);
  const Answered revoked = ask("POST", "/api/v1/enrolments/rheo-1/revoke");
  EXPECT_EQ(revoked.status, 200) << revoked.body;
  EXPECT_EQ(revoked.parsed()["revoked_by"], "token:local");
  EXPECT_EQ(ask("POST", "/api/v1/enrolments/nobody/revoke").status, 404);
  const Answered again = ask("POST", "/api/v1/enrolments", {{"robot_id", "rheo-1"}});
  EXPECT_EQ(again.status, 201);
  EXPECT_EQ(again.parsed()["revoked_at_us"], nullptr);
  EXPECT_NE(again.parsed()["secret"], made.parsed()["secret"]);
}

// SAFETY: no stop would arrive at a robot that its new token keeps out.
TEST_F(AccountsTest, ARobotThatIsDrivenIsGivenNoToken) {
  connect_robot();
  auto frame = TestRobot::samples_frame(0, 1, robot->robot_now_us(), 0);
  frame.body.telemetry.duty[0] = 0.3F;
  robot->send(frame);
  clock.settle();
  const Answered refused = ask("POST", "/api/v1/enrolments", {{"robot_id", "r1"}});
  EXPECT_EQ(refused.status, 409);
  EXPECT_EQ(refused.parsed()["reason"], "motor_on");
  EXPECT_EQ(station.find("r1")->link, station::LinkState::connected);
  frame = TestRobot::samples_frame(1, 1, robot->robot_now_us(), 0);
  frame.body.telemetry.duty[0] = 0;
  robot->send(frame);
  clock.settle();
  EXPECT_EQ(ask("POST", "/api/v1/enrolments", {{"robot_id", "r1"}}).status, 201);
}

TEST_F(AccountsTest, RevokingEndsTheConnectionAndKeepsTheRobotOut) {
  connect_robot();
  make_samples(*robot, 0, 10);
  make_samples(*robot, 15, 5);  // 10 to 14 are missing
  const Answered revoked = ask("POST", "/api/v1/enrolments/r1/revoke");
  ASSERT_EQ(revoked.status, 200) << revoked.body;
  EXPECT_EQ(revoked.parsed()["samples_given_up"], 5);
  ASSERT_TRUE(clock.run_until([&] { return robot->closed; }, 1s));
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["link"], "disconnected");
  TestRobot back{loop, clock, tasks, robots};
  back.say_hello();
  ASSERT_TRUE(clock.run_until([&] { return back.closed; }, 1s));
  EXPECT_EQ(back.welcomes().at(0).refusal, rheonaut_REFUSAL_REASON_WRONG_TOKEN);
  const json events = ask("GET", "/api/v1/robots/r1/events").parsed()["events"];
  EXPECT_EQ(events[0]["kind"], "connection_refused") << events[0];
  EXPECT_NE(events[0]["detail"].get<std::string>().find("revoked"), std::string::npos);
  EXPECT_EQ(ask("POST", "/api/v1/enrolments", {{"robot_id", "r1"}}).status, 201);
}

TEST_F(AccountsTest, NoExportOfARunHoldsAnyOfIt) {
  connect_robot();
  ASSERT_EQ(make_user("very-secret-user"), 201);
  make_token("very-secret-token");
  const json run = ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "x"}}).parsed();
  make_samples(*robot, 0, 5);
  clock.run_for(2s);
  const std::string path = "/api/v1/runs/" + run["run_id"].dump() + "/samples.sqlite";
  ASSERT_EQ(ask("POST", "/api/v1/runs/" + run["run_id"].dump() + "/end").status, 200);
  const Answered file = ask("GET", path);
  ASSERT_EQ(file.status, 200);
  ASSERT_TRUE(file.body.starts_with("SQLite format 3"));
  for (const char* word : {"very-secret", "api_token", "page_session", "password_hash", "token_hash", "argon2id"}) {
    EXPECT_EQ(file.body.find(word), std::string::npos) << word;
  }
}

// SAFETY's test: whatever fails, what moves comes to its end.
TEST(Rights, APartThatFailsKeepsNoOtherOneFromItsEnd) {
  identity::Rights rights;
  const auto nobody = [] { return std::set<std::string>{}; };
  const auto fails = [](const runtime::EndedRight&) { throw std::runtime_error{"a fault"}; };
  bool has_ended = false;
  rights.add({"what fails", identity::Scope::command, nobody, fails});
  rights.add({"the next", identity::Scope::command, nobody, [&](const runtime::EndedRight&) { has_ended = true; }});
  rights.end({[](const std::string&) { return true; }, "a test"}, {});
  EXPECT_TRUE(has_ended);
}

}  // namespace
}  // namespace server
