// What a page on /live may do, and that it ends with the session or token that it rests on.
#include "server/identity/accounts.hpp"
#include "tests/server/api/live_page.hpp"

namespace server {
namespace {

class LiveRightsTest : public ApiTest {
 protected:
  std::string make_token(const std::string& name, const std::string& scopes_of_token) {
    const Answered made = ask("POST", "/api/v1/tokens", {{"name", name}, {"scopes", scopes_of_token}});
    EXPECT_EQ(made.status, 201) << made.body;
    return made.parsed()["secret"];
  }
  std::unique_ptr<Page> open(const std::string& secret) {
    return std::make_unique<Page>(clock, port(), "Authorization: Bearer " + secret + "\r\n");
  }
  std::unique_ptr<Page> open_by_cookie(const std::string& secret) {
    return std::make_unique<Page>(clock, port(), "Cookie: rheonaut_session_fedcba9876543210=" + secret + "\r\n");
  }
  std::string make_session(const std::string& user) { return accounts().open_session(user, "", ""); }
  void add_user(const std::string& name, const std::string& role) {
    const json body{{"name", name}, {"role", role}, {"password", "correct horse"}};
    EXPECT_EQ(ask("POST", "/api/v1/users", body).status, 201);
  }
  // It ended within this second, and not for want of a sign of life.
  bool ends(Page& page) {
    clock.run_for(1s);
    page.receive("nothing of this type");
    return page.closed();
  }
  std::size_t stops() const {
    const auto all = robot->commands();
    return static_cast<std::size_t>(std::ranges::count_if(all, [](const protocol::Command& command) {
      return command.which_action == rheonaut_Command_emergency_stop_tag;
    }));
  }
};

TEST_F(LiveRightsTest, AViewerSeesAndStopsAndRenewsNothing) {
  connect_robot();
  add_user("vera", "viewer");
  const auto page = open_by_cookie(make_session("vera"));
  ASSERT_TRUE(page->open()) << page->answer;
  EXPECT_EQ(page->receive("welcome")["robots"][0]["robot_id"], "r1");
  page->say({{"type", "renew_lease"}, {"robot_id", "r1"}, {"stamp_us", clock.steady_us()}});
  const json problem = page->receive("problem");
  EXPECT_EQ(problem["problem"]["reason"], "not_permitted") << problem;
  EXPECT_EQ(problem["problem"]["needs"], "operator");
  page->say({{"type", "take_over_the_world"}});
  EXPECT_EQ(page->receive("problem")["problem"]["reason"], "not_permitted") << "what is not known needs a commander";
  page->say({{"type", "keep_alive"}});
  page->say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  EXPECT_TRUE(clock.run_until([&] { return stops() == 1; }, 1s));
}

TEST_F(LiveRightsTest, ATokenThatMayOnlyReadNeitherStopsNorCommands) {
  connect_robot();
  const auto page = open(make_token("logger", "read"));
  ASSERT_TRUE(page->open()) << page->answer;
  page->say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  const json problem = page->receive("problem")["problem"];
  EXPECT_EQ(problem["reason"], "not_permitted");
  EXPECT_EQ(problem["needs"], "viewer") << "which may stop; this token may not";
  EXPECT_EQ(stops(), 0U);
}

TEST_F(LiveRightsTest, WhoMaySeeNothingOpensNoPage) {
  EXPECT_TRUE(open(make_token("button", "stop"))->answer.starts_with("HTTP/1.1 403 "));
}

TEST_F(LiveRightsTest, ARevokedSessionEndsItsPagesAndNoOther) {
  const std::string mine = make_session("");
  const auto page = open_by_cookie(mine);
  const auto twin = open_by_cookie(mine);
  const auto other = open_by_cookie(make_session(""));
  ASSERT_TRUE(page->open() && twin->open() && other->open());
  const json sessions = ask("GET", "/api/v1/sessions").parsed()["sessions"];
  ASSERT_EQ(sessions.size(), 2U);
  const auto number = sessions[0]["session"].get<std::uint64_t>();
  EXPECT_EQ(ask("POST", "/api/v1/sessions/" + std::to_string(number) + "/revoke").status, 200);
  EXPECT_EQ(ask("POST", "/api/v1/sessions/" + std::to_string(number) + "/revoke").status, 404);
  EXPECT_TRUE(ends(*page));
  EXPECT_EQ(page->close_code, 1008);
  EXPECT_TRUE(ends(*twin));
  EXPECT_FALSE(other->closed());
  EXPECT_TRUE(open_by_cookie(mine)->answer.starts_with("HTTP/1.1 401 "));
}

TEST_F(LiveRightsTest, ARevokedOrOldTokenEndsItsPages) {
  const std::string secret = make_token("a", "read,stop");
  const auto page = open(secret);
  ASSERT_TRUE(page->open());
  EXPECT_EQ(ask("POST", "/api/v1/tokens/a/revoke").status, 200);
  EXPECT_TRUE(ends(*page));
  EXPECT_TRUE(open(secret)->answer.starts_with("HTTP/1.1 401 "));

  const Answered made = ask("POST", "/api/v1/tokens", {{"name", "b"}, {"scopes", "read"}, {"days", 1}});
  const std::string short_lived = made.parsed()["secret"];
  std::optional<identity::Caller> caller = accounts().caller_of_token(short_lived);
  ASSERT_TRUE(caller);
  clock.skip(24h - 1min);
  clock.settle();
  EXPECT_FALSE(caller->standing->ended());
  clock.run_for(2min);
  EXPECT_TRUE(caller->standing->ended());
  EXPECT_TRUE(open(short_lived)->answer.starts_with("HTTP/1.1 401 "));
}

TEST_F(LiveRightsTest, AUserWithAnotherRoleComesBackWithIt) {
  connect_robot();
  add_user("otto", "operator");
  const std::string secret = make_session("otto");
  const auto page = open_by_cookie(secret);
  ASSERT_TRUE(page->open());
  EXPECT_EQ(ask("POST", "/api/v1/users/otto/change", {{"role", "viewer"}}).status, 200);
  EXPECT_TRUE(ends(*page)) << "what it may do was decided when it opened";
  const auto again = open_by_cookie(secret);
  ASSERT_TRUE(again->open()) << "the session goes on";
  again->say({{"type", "renew_lease"}, {"robot_id", "r1"}, {"stamp_us", clock.steady_us()}});
  EXPECT_EQ(again->receive("problem")["problem"]["reason"], "not_permitted");
  EXPECT_EQ(ask("POST", "/api/v1/users/otto/change", {{"disabled", true}}).status, 200);
  EXPECT_TRUE(ends(*again));
  EXPECT_TRUE(open_by_cookie(secret)->answer.starts_with("HTTP/1.1 401 "));
}

// SAFETY: nobody keeps a robot from others that they may not command themselves.
TEST_F(LiveRightsTest, WhoMayCommandNoMoreKeepsNoControl) {
  connect_robot();
  add_user("otto", "operator");
  const std::string secret = make_session("otto");
  const auto stay = [this](Page& page) {
    for (int i = 0; i < 50; ++i) {
      page.say({{"type", "keep_alive"}, {"stamp_us", clock.steady_us()}});
      clock.run_for(100ms);
    }
  };
  const auto page = open_by_cookie(secret);
  ASSERT_TRUE(page->open());
  station::ControlRequest take;
  take.robot_id = "r1";
  take.actor = page->receive("welcome")["actor"];
  ASSERT_TRUE(station.control(take));
  stay(*page);
  EXPECT_EQ(station.holder("r1"), take.actor);
  ASSERT_EQ(ask("POST", "/api/v1/users/otto/change", {{"role", "viewer"}}).status, 200);
  const auto again = open_by_cookie(secret);
  ASSERT_TRUE(again->open());
  stay(*again);
  EXPECT_EQ(station.holder("r1"), "");
}

TEST_F(LiveRightsTest, SigningOutEndsTheSessionAndItsPages) {
  const std::string secret = make_session("");
  const auto page = open_by_cookie(secret);
  ASSERT_TRUE(page->open());
  RawClient client{clock, port()};
  client.send(
      "POST /api/v1/logout HTTP/1.1\r\nHost: localhost\r\nOrigin: http://localhost\r\nContent-Length: 0\r\n"
      "Connection: close\r\nCookie: rheonaut_session_fedcba9876543210=" +
      secret + "\r\n\r\n");
  const std::string answer = client.read_to_end();
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
  EXPECT_NE(answer.find("rheonaut_session_fedcba9876543210=; HttpOnly; SameSite=Strict; Path=/; Max-Age=0"),
            std::string::npos)
      << answer;
  EXPECT_TRUE(ends(*page));
  EXPECT_EQ(ask("POST", "/api/v1/logout").status, 409) << "a token has no session";
}

}  // namespace
}  // namespace server
