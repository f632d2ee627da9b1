// Reservations over the routes: who makes, lists and cancels them; what they keep whom from; what is shown.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "server/identity/accounts.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class ReservationRoutesTest : public ApiTest {
 protected:
  ReservationRoutesTest() {
    connect_robot();
    tasks.spawn("control", station.watch_control());
  }

  void as(const std::string& who, identity::Role role = identity::Role::operator_) {
    actor = who;
    scopes = identity::Scopes::of(role);
  }
  Answered reserve(const json& body) { return ask("POST", "/api/v1/robots/r1/reservations", body); }
  Answered cancel(int id) { return ask("POST", fmt::format("/api/v1/reservations/{}/cancel", id)); }
  Answered take(const json& more = {{"action", "take"}}) { return ask("POST", "/api/v1/robots/r1/control", more); }
  std::string reason(const Answered& answered) { return answered.parsed().value("reason", ""); }
  json shown() { return ask("GET", "/api/v1/robots/r1").parsed()["reservation"]; }
  void add_token(const char* name, const char* owner) {
    bool is_made = false;
    tasks.spawn("token", made_token({name, scopes, 0, owner}, is_made));
    ASSERT_TRUE(clock.run_until([&] { return is_made; }, 10s));
  }
  boost::asio::awaitable<void> made_token(identity::TokenRequest request, bool& is_made) {
    station::Author by{"token:local", "", clock.utc_us()};
    const auto made = co_await accounts().add_token(std::move(request), std::move(by));
    is_made = made.has_value();
  }
  void add_user(const char* name) {
    const Answered added =
        ask("POST", "/api/v1/users", {{"name", name}, {"role", "operator"}, {"password", "correct horse"}});
    ASSERT_EQ(added.status, 201) << added.body;
  }
};

TEST_F(ReservationRoutesTest, IsMadeShownAndKeepsOthersOutUntilItIsOver) {
  as("user:anna/session:4");
  EXPECT_EQ(shown(), nullptr);
  const Answered made = reserve({{"for_s", 600}, {"purpose", "bed 3"}});
  ASSERT_EQ(made.status, 201) << made.body;
  const json reservation = made.parsed();
  EXPECT_EQ(reservation["reservation_id"], 1);
  EXPECT_EQ(reservation["holder"], "user:anna");
  EXPECT_EQ(reservation["made_by"], "user:anna/session:4");
  EXPECT_EQ(reservation["until_us"].get<std::int64_t>() - reservation["from_us"].get<std::int64_t>(), 600'000'000);
  EXPECT_EQ(shown(), reservation);
  as("token:ci");
  const Answered refused = take();
  EXPECT_EQ(refused.status, 409);
  EXPECT_EQ(reason(refused), "reserved");
  EXPECT_THAT(refused.parsed()["detail"].get<std::string>(), HasSubstr("reserved for user:anna until"));
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/fluid", {{"fluid", "water"}}).status, 409);
  as("user:anna/session:5");
  EXPECT_EQ(take().status, 200) << "another page of hers";
  EXPECT_EQ(take({{"action", "release"}}).status, 200);
  clock.run_for(600s);
  EXPECT_EQ(shown(), nullptr);
  as("token:ci");
  EXPECT_EQ(take().status, 200);
}

TEST_F(ReservationRoutesTest, BodiesAreCheckedMemberByMember) {
  as("token:ci");
  const std::int64_t now_us = clock.utc_us();
  EXPECT_EQ(reserve(json::object()).status, 400);
  EXPECT_EQ(reserve({{"for_s", 1}, {"until_us", now_us + 1'000'000}}).status, 400);
  EXPECT_EQ(reserve({{"for_s", 0}}).status, 422);
  EXPECT_EQ(reserve({{"for_s", 604'801}}).status, 422);
  EXPECT_EQ(reserve({{"for_s", "long"}}).status, 400);
  EXPECT_EQ(reserve({{"for_s", 60}, {"colour", "red"}}).status, 400);
  EXPECT_EQ(reserve({{"until_us", now_us - 1}}).status, 422) << "over";
  EXPECT_EQ(reserve({{"from_us", now_us + 10}, {"until_us", now_us + 10}}).status, 422);
  EXPECT_EQ(reserve({{"from_us", 9223372036854775807}, {"for_s", 60}}).status, 422);
  EXPECT_EQ(reserve({{"from_us", 0}, {"until_us", 9223372036854775807}}).status, 422);
  EXPECT_EQ(reserve({{"for_s", 60}, {"purpose", std::string(201, 'x')}}).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/robots/nobody/reservations", {{"for_s", 60}}).status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/reservations?over=perhaps").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/reservations").parsed()["reservations"], json::array());
}

TEST_F(ReservationRoutesTest, AnotherSlotIsNamedAndSlotsMayMeet) {
  as("user:anna/session:4");
  const std::int64_t at_us = clock.utc_us() + 3'600'000'000;
  ASSERT_EQ(reserve({{"from_us", at_us}, {"for_s", 60}}).status, 201);
  as("token:ci");
  const Answered refused = reserve({{"from_us", at_us + 59'999'999}, {"for_s", 60}});
  EXPECT_EQ(refused.status, 409);
  EXPECT_EQ(reason(refused), "reserved");
  EXPECT_THAT(refused.parsed()["detail"].get<std::string>(), HasSubstr("user:anna"));
  EXPECT_EQ(reserve({{"from_us", at_us + 60'000'000}, {"for_s", 60}}).status, 201);
  EXPECT_EQ(reserve({{"until_us", at_us}}).status, 201);
  const json listed = ask("GET", "/api/v1/reservations?robot_id=r1&over=false").parsed()["reservations"];
  ASSERT_EQ(listed.size(), 3U);
  EXPECT_EQ(listed[0]["reservation_id"], 3);
}

TEST_F(ReservationRoutesTest, OnlyAnAdministratorReservesForSomebodyElse) {
  add_user("anna");
  as("user:ben/session:4");
  EXPECT_EQ(reserve({{"for_s", 60}, {"holder", "user:anna"}}).status, 403);
  EXPECT_EQ(reserve({{"for_s", 60}, {"holder", "user:ben"}}).status, 201) << "it is his own account";
  EXPECT_EQ(cancel(1).status, 200);
  as("token:local", identity::Role::admin);
  EXPECT_EQ(reserve({{"for_s", 60}, {"holder", "user:nobody"}}).status, 422);
  EXPECT_EQ(reserve({{"for_s", 60}, {"holder", "anna"}}).status, 422);
  const Answered made = reserve({{"for_s", 60}, {"holder", "user:anna"}});
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(made.parsed()["holder"], "user:anna");
  EXPECT_EQ(reason(take()), "reserved") << "an administrator, too, must force it or cancel it";
  EXPECT_EQ(take({{"action", "force"}, {"reason", "the tube leaks"}}).status, 200);
}

TEST_F(ReservationRoutesTest, ATokenOfAUserCountsAsTheUser) {
  add_user("anna");
  add_token("annas", "anna");
  add_token("lab", "");
  const identity::Accounts& accounts = ApiTest::accounts();
  EXPECT_EQ(accounts.account_of("token:annas"), "user:anna");
  EXPECT_EQ(accounts.account_of("token:lab"), "token:lab");
  EXPECT_EQ(accounts.account_of("user:anna/session:4"), "user:anna");
  EXPECT_EQ(accounts.account_of("session:4"), "session:4");
  EXPECT_TRUE(accounts.is_account("user:anna"));
  EXPECT_TRUE(accounts.is_account("token:lab"));
  EXPECT_FALSE(accounts.is_account("token:annas")) << "it is hers";
  EXPECT_FALSE(accounts.is_account("session:4"));
  as("token:annas");
  EXPECT_EQ(reserve({{"for_s", 60}}).parsed()["holder"], "user:anna");
  EXPECT_EQ(take().status, 200);
  EXPECT_EQ(take({{"action", "release"}}).status, 200);
  as("user:anna/session:4");
  EXPECT_EQ(take().status, 200);
  as("token:lab");
  EXPECT_EQ(reason(take()), "reserved");
}

TEST_F(ReservationRoutesTest, IsCancelledByItsAccountOrAnAdministrator) {
  as("user:anna/session:4");
  ASSERT_EQ(reserve({{"for_s", 600}}).status, 201);
  as("token:ci");
  EXPECT_EQ(cancel(1).status, 403);
  EXPECT_EQ(cancel(9).status, 404);
  EXPECT_EQ(ask("POST", "/api/v1/reservations/x/cancel").status, 404);
  as("user:anna/session:9");
  const Answered cancelled = cancel(1);
  ASSERT_EQ(cancelled.status, 200) << cancelled.body;
  EXPECT_EQ(cancelled.parsed()["cancelled_by"], "user:anna/session:9");
  EXPECT_EQ(shown(), nullptr);
  EXPECT_EQ(cancel(1).status, 409);
  as("token:ci");
  EXPECT_EQ(take().status, 200);
  EXPECT_EQ(take({{"action", "release"}}).status, 200);
  ASSERT_EQ(reserve({{"for_s", 600}}).status, 201);
  as("user:root/session:1", identity::Role::admin);
  EXPECT_EQ(cancel(2).status, 200);
}

TEST_F(ReservationRoutesTest, WhoIsInControlKeepsItForTheNotice) {
  as("token:ci");
  ASSERT_EQ(take({{"action", "take"}, {"lease_ms", 600'000}}).status, 200);
  as("user:anna/session:4");
  EXPECT_EQ(reason(reserve({{"for_s", 600}})), "not_in_control");
  EXPECT_EQ(reserve({{"from_us", clock.utc_us() + 600'000'000}, {"for_s", 600}}).status, 201);
  as("user:root/session:1", identity::Role::admin);
  ASSERT_EQ(reserve({{"for_s", 60}}).status, 201);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["control"], nullptr) << "an administrator ends it";
}

TEST_F(ReservationRoutesTest, AViewerSeesThemAndChangesNothing) {
  as("user:anna/session:4");
  ASSERT_EQ(reserve({{"for_s", 600}}).status, 201);
  as("user:eve/session:6", identity::Role::viewer);
  EXPECT_EQ(reserve({{"from_us", clock.utc_us() + 600'000'000}, {"for_s", 600}}).status, 403);
  EXPECT_EQ(cancel(1).status, 403);
  EXPECT_EQ(ask("GET", "/api/v1/reservations").parsed()["reservations"].size(), 1U);
  const auto stopping = begin("POST", "/api/v1/robots/r1/emergency-stop");
  EXPECT_EQ(robot->commands().size(), 1U) << "SAFETY: everybody stops a reserved robot";
}

}  // namespace
}  // namespace server
