// Who did what, when and from where, as the route reports it: of commands, refusals, control, sign-ins and accounts.
#include <gmock/gmock.h>

#include "server/identity/accounts.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/upkeep/audit_check.hpp"
#include "tests/server/api/live_page.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class AuditRoutesTest : public ApiTest {
 protected:
  static constexpr const char* kCommands = "/api/v1/robots/r1/commands";

  json audit(const std::string& query = "") {
    const Answered answered = ask("GET", "/api/v1/audit" + query);
    EXPECT_EQ(answered.status, 200) << answered.body;
    return answered.parsed();
  }
  // Oldest first.
  std::vector<std::string> actions(const std::string& query = "") {
    std::vector<std::string> found;
    for (const json& entry : audit(query)["entries"]) found.insert(found.begin(), entry["action"]);
    return found;
  }
  json latest(const std::string& action) {
    const json entries = audit("?limit=1&action=" + action)["entries"];
    return entries.empty() ? json(nullptr) : entries[0];
  }
  Answered command(const json& body) {
    const std::size_t before = robot->commands().size();
    const auto asked = begin("POST", kCommands, body);
    if (robot->commands().size() > before) {
      robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, 0);
    }
    return end(asked);
  }
  void expect_whole_chain() {
    SQLite::Database database = storage::open_for_reading(recorder.path());
    EXPECT_THAT(storage::check_audit(database, {}).faults, IsEmpty());
  }
};

TEST_F(AuditRoutesTest, ACommandIsThereFromItsRequestToItsEnd) {
  connect_robot();
  EXPECT_EQ(command({{"kind", "set_duty"}, {"duty", 0.25}}).status, 200);
  const json taken = latest("control.taken");
  EXPECT_EQ(taken["actor"], "token:local");
  EXPECT_EQ(taken["peer"], "127.0.0.1");
  EXPECT_EQ(taken["detail"]["holder"], "token:local");
  const json done = latest("command.acknowledged");
  EXPECT_EQ(done["actor"], "token:local");
  EXPECT_EQ(done["peer"], "127.0.0.1");
  EXPECT_EQ(done["robot_id"], "r1");
  EXPECT_EQ(done["detail"]["kind"], "set_duty");
  EXPECT_EQ(done["detail"]["arguments"], (json{{"duty", 0.25}}));
  EXPECT_EQ(done["detail"]["life_from"], "arrival");
  EXPECT_TRUE(done["detail"].contains("sent_after_us"));
  EXPECT_TRUE(done["detail"].contains("acknowledged_after_us"));
  expect_whole_chain();
}

TEST_F(AuditRoutesTest, AStopIsSentBeforeItIsWrittenAndIsWritten) {
  connect_robot();
  SQLite::Database other{recorder.path().string(), SQLite::OPEN_READWRITE};
  other.exec("BEGIN IMMEDIATE");  // SAFETY: the audit cannot be written, and the stop goes
  const auto stopping = begin("POST", "/api/v1/robots/r1/emergency-stop");
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  EXPECT_EQ(end(stopping, 1s).status, 200);
  other.exec("ROLLBACK");
  clock.run_for(3s);
  const json stop = latest("command.acknowledged");
  EXPECT_EQ(stop["detail"]["kind"], "emergency_stop");
  EXPECT_EQ(stop["detail"]["emergency_id"], "9");
  EXPECT_EQ(stop["peer"], "127.0.0.1");
  expect_whole_chain();
}

TEST_F(AuditRoutesTest, WhatIsRefusedIsThereWithTheReason) {
  connect_robot();
  EXPECT_EQ(command({{"kind", "set_duty"}, {"duty", 7}}).status, 422);
  EXPECT_EQ(latest("command.refused")["detail"]["arguments"], (json{{"duty", 7}}));
  EXPECT_EQ(command({{"kind", "fly"}}).status, 422);
  EXPECT_THAT(latest("command.refused")["detail"]["problem"], HasSubstr("fly"));
  const json force{{"action", "force"}, {"reason", "he is asleep"}};
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/control", force).status, 403);
  EXPECT_EQ(ask("GET", "/api/v1/audit").status, 403);
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("POST", kCommands, {{"kind", "set_duty"}, {"duty", 0.1}}).status, 403);
  scopes = identity::Scopes::of(identity::Role::admin);
  EXPECT_EQ(latest("control.refused")["detail"]["reason"], "not_permitted");
  EXPECT_EQ(latest("request.refused")["subject"], kCommands);
  EXPECT_EQ(latest("request.refused")["detail"], (json{{"method", "POST"}, {"needs", "command"}}));
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/control", force).status, 200);
  EXPECT_THAT(latest("control.forced")["detail"]["cause"], HasSubstr("he is asleep"));
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/control", {{"action", "hand_over"}}).status, 409);
  EXPECT_EQ(latest("control.refused")["detail"]["wish"], "hand_over");
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/control", {{"action", "release"}}).status, 200);
  EXPECT_EQ(latest("control.released")["detail"]["holder"], "");
  expect_whole_chain();
}

// What does not reach the robot must not reach the disk without bound either.
TEST_F(AuditRoutesTest, TenThousandRefusedCommandsLeaveAHundredEntriesAndACount) {
  connect_robot();
  const std::int64_t before = audit()["entries"][0]["entry"];
  for (int n = 0; n < 10'000; ++n) ASSERT_EQ(command({{"kind", "set_duty"}, {"duty", 7}}).status, 422);
  clock.run_for(11s);
  const std::int64_t after = audit()["entries"][0]["entry"];
  EXPECT_LE(after - before, 120);
  EXPECT_GT(latest("audit.left_out")["detail"]["count"], 1000);
}

TEST_F(AuditRoutesTest, AccountsSessionsAndSignInsAreThereWithoutSecrets) {
  // Written before the next one: what is queued and what is stored at once are entries in the order of their commits.
  const auto post = [this](const char* path, const json& body = nullptr) {
    Answered answered = ask("POST", path, body);
    clock.run_for(200ms);
    return answered;
  };
  const json anna{{"name", "anna"}, {"role", "viewer"}, {"password", "correct horse"}};
  EXPECT_EQ(post("/api/v1/users", anna).status, 201);
  EXPECT_EQ(post("/api/v1/login", {{"user", "anna"}, {"password", "wrong horse"}}).status, 401);
  EXPECT_EQ(post("/api/v1/login", {{"user", "my-password-in-the-wrong-field"}, {"password", "x"}}).status, 401);
  EXPECT_EQ(post("/api/v1/login", {{"user", "anna"}, {"password", "correct horse"}}).status, 200);
  EXPECT_EQ(post("/api/v1/users/anna/change", {{"role", "operator"}, {"password", "correct mare"}}).status, 200);
  EXPECT_EQ(post("/api/v1/tokens", {{"name", "ci"}, {"scopes", "read"}}).status, 201);
  EXPECT_EQ(post("/api/v1/tokens/ci/revoke").status, 200);
  accounts().open_session("", "10.0.0.5", "");
  clock.run_for(200ms);
  EXPECT_EQ(post("/api/v1/sessions/2/revoke").status, 200);
  EXPECT_EQ(post("/api/v1/users/anna/remove").status, 200);
  EXPECT_THAT(actions("?action=account"),
              ElementsAre("account.user_added", "account.sign_in_refused", "account.sign_in_refused",
                          "account.signed_in", "account.user_changed", "account.token_made", "account.token_revoked",
                          "account.signed_in", "account.session_ended", "account.user_removed"));
  const json all = audit("?action=account");
  EXPECT_EQ(all["entries"][8]["subject"], "anna");
  EXPECT_EQ(all["entries"][7]["subject"], "") << "what was typed may be a password";
  EXPECT_EQ(all["entries"][6]["actor"], "user:anna/session:1");
  EXPECT_EQ(all["entries"][5]["detail"]["password"], "changed");
  EXPECT_EQ(all["entries"][2]["peer"], "10.0.0.5");
  for (const char* secret : {"horse", "mare", "my-password", "argon2", "hash_of"}) {
    EXPECT_EQ(all.dump().find(secret), std::string::npos) << secret;
  }
  expect_whole_chain();
}

TEST_F(AuditRoutesTest, APagesMessagesComeFromItsAddress) {
  connect_robot();
  Page page{clock, port(), "Authorization: Bearer " + token() + "\r\n"};
  ASSERT_TRUE(page.open()) << page.answer;
  page.say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 1s));
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.run_for(1s);
  EXPECT_EQ(latest("command.acknowledged")["peer"], "127.0.0.1");
  page.say({{"type", "renew_lease"}, {"robot_id", "r1"}, {"stamp_us", clock.steady_us() - 500'000}});
  EXPECT_EQ(page.receive("problem")["problem"]["reason"], "stale");
  EXPECT_EQ(latest("command.refused")["detail"]["reason"], "stale");
  EXPECT_EQ(latest("command.refused")["peer"], "127.0.0.1");
}

TEST_F(AuditRoutesTest, PagesGoBackToTheFirstEntryAndTellTheHead) {
  connect_robot();
  for (int n = 0; n < 5; ++n) EXPECT_EQ(command({{"kind", "set_duty"}, {"duty", 0.25}}).status, 200);
  std::vector<std::int64_t> entries;
  std::string next = "?limit=2";
  while (!next.empty()) {
    const json page = audit(next);
    for (const json& entry : page["entries"]) entries.push_back(entry["entry"]);
    const std::string head = page["head"];
    EXPECT_TRUE(head.starts_with(std::to_string(entries.front()) + ":")) << head;
    next = page["next"].is_null() ? "" : "?limit=2&before=" + page["next"].dump();
  }
  EXPECT_EQ(entries.back(), 1);
  EXPECT_TRUE(std::ranges::is_sorted(entries, std::greater{}));
  EXPECT_EQ(entries.size(), static_cast<std::size_t>(entries.front()));
  EXPECT_THAT(actions("?robot_id=&action=station"), ElementsAre("station.started"));
  EXPECT_THAT(actions("?actor=nobody"), IsEmpty());
  EXPECT_THAT(actions("?to_us=5"), IsEmpty());
  const std::int64_t started_us = latest("station.started")["at_us"];
  const auto until = [&](std::int64_t us) { return actions("?action=station&to_us=" + std::to_string(us)); };
  EXPECT_THAT(until(started_us), IsEmpty()) << "to_us is the first moment after, as in every list";
  EXPECT_THAT(until(started_us + 1), ElementsAre("station.started"));
  EXPECT_THAT(actions("?action=station&from_us=" + std::to_string(started_us)), ElementsAre("station.started"));
  for (const char* bad : {"?limit=0", "?before=0", "?from_us=x", "?who=anna", "?to_us=0", "?from_us=7&to_us=7"}) {
    EXPECT_EQ(ask("GET", std::string{"/api/v1/audit"} + bad).status, 400) << bad;
  }
}

}  // namespace
}  // namespace server
