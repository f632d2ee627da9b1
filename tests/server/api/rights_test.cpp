// Every route under every role and scope: who may do what, and the answers to those who may not.
#include <set>

#include "server/http/router.hpp"
#include "server/identity/accounts.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class RightsTest : public ApiTest {
 protected:
  static std::string target_of(const std::string& pattern) {
    std::string target;
    for (std::size_t i = 0; i < pattern.size(); ++i) {
      target += pattern[i] == '{' ? '1' : pattern[i];
      if (pattern[i] == '{') i = pattern.find('}', i);
    }
    return target;
  }
  bool refused(const http::Route& route) {
    const Answered answered = ask(route.method, target_of(route.pattern));
    if (answered.status != 403) return false;
    const json problem = answered.parsed();
    EXPECT_EQ(problem["reason"], "not_permitted") << route.pattern;
    EXPECT_EQ(problem["needs"], text(least_role(route.needs))) << route.pattern;
    EXPECT_NE(problem["detail"].get<std::string>().find(text(least_role(route.needs))), std::string::npos);
    return true;
  }
};

TEST_F(RightsTest, EveryRouteIsOpenToTheRolesThatItsScopeNamesAndToNoOther) {
  std::map<std::string, int> open;
  for (const identity::Role role : identity::kRoles) {
    scopes = identity::Scopes::of(role);
    for (const http::Route& route : router().routes()) {
      const bool may = role >= least_role(route.needs);
      EXPECT_EQ(refused(route), !may) << text(role) << ": " << route.method << " " << route.pattern;
      open[text(role)] += may ? 1 : 0;
    }
  }
  EXPECT_GE(open["viewer"], 25);
  EXPECT_GT(open["operator"], open["viewer"]);
  EXPECT_GT(open["admin"], open["operator"]);
}

TEST_F(RightsTest, WithoutACredentialOnlySigningInAndHealthAreThere) {
  scopes = {};
  std::set<std::string> open;
  for (const http::Route& route : router().routes()) {
    if (!refused(route)) open.insert(route.method + " " + route.pattern);
  }
  EXPECT_EQ(open,
            (std::set<std::string>{"GET /foxglove", "GET /healthz", "GET /login", "GET /readyz", "POST /api/v1/login"}))
      << "/foxglove has a ticket of its own, foxglove_socket_test.cpp";
}

// Written out, so that a route that changes its scope by accident is noticed here.
TEST_F(RightsTest, AViewerChangesNothingButMayStop) {
  std::set<std::string> changes;
  for (const http::Route& route : router().routes()) {
    if (route.method != "GET" && least_role(route.needs) == identity::Role::viewer) changes.insert(route.pattern);
  }
  EXPECT_EQ(changes,
            (std::set<std::string>{"/api/v1/emergency-stop", "/api/v1/experiments/{experiment_id}/abort",
                                   "/api/v1/experiments/{experiment_id}/pause", "/api/v1/foxglove-links",
                                   "/api/v1/robots/{robot_id}/emergency-stop", "/api/v1/login", "/api/v1/logout"}));
  std::set<std::string> of_admins;
  for (const http::Route& route : router().routes()) {
    if (route.needs == identity::Scope::admin) of_admins.insert(route.method + " " + route.pattern);
  }
  EXPECT_TRUE(of_admins.contains("POST /api/v1/login-links")) << "a link signs in as admin";
  EXPECT_TRUE(of_admins.contains("POST /api/v1/backups"));
  EXPECT_TRUE(of_admins.contains("GET /api/v1/audit")) << "it has addresses and sign-ins";
  EXPECT_TRUE(of_admins.contains("POST /api/v1/robots/{robot_id}/retire")) << "the stop of all leaves it out";
  EXPECT_TRUE(of_admins.contains("POST /api/v1/recording/losses/acknowledge"));
  EXPECT_TRUE(of_admins.contains("POST /api/v1/recording/clock/accept")) << "it lets things be removed";
  EXPECT_TRUE(of_admins.contains("POST /api/v1/tokens/{token}/revive")) << "it gives a right back";
  EXPECT_EQ(of_admins.size(), 20U);
}

// Where the body, or whose it is, decides. (The fixture sees that no 403 is without `needs`.)
TEST_F(RightsTest, ARefusalSaysWhichRoleWouldDoIt) {
  connect_robot();
  make_samples(*robot, 0, 25);
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}});
  ask("POST", "/api/v1/jobs", {{"kind", "report"}, {"runs", {1}}});
  ask("POST", "/api/v1/robots/r1/reservations", {{"for_s", 60}, {"from_us", clock.utc_us() + 3'600'000'000}});
  const auto needs = [this](const std::string& target, const json& body) {
    const Answered refused = ask("POST", "/api/v1" + target, body);
    EXPECT_EQ(refused.status, 403) << target << refused.body;
    return refused.parsed().value("needs", json("none"));
  };
  actor = "token:other";
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(needs("/robots/r1/control", {{"action", "force"}, {"reason", "lunch"}}), "admin");
  EXPECT_EQ(needs("/robots/r1/commands",
                  {{"kind", "set_parameter"}, {"name", "position_limit_max_m"}, {"value", 0.2}, {"confirm", true}}),
            "admin");
  EXPECT_EQ(needs("/jobs/1/cancel", nullptr), "admin");
  EXPECT_EQ(needs("/reservations/1/cancel", nullptr), "admin");
  EXPECT_EQ(needs("/robots/r1/reservations", {{"for_s", 60}, {"holder", "token:local"}}), "admin");
  const json unattended{{"robot_id", "r1"}, {"profile", "figure_7"}, {"unattended", true}};
  EXPECT_EQ(needs("/experiments", unattended), nullptr) << "the configuration forbids it, to everybody";
  scopes = identity::parse_scopes("record").value();
  EXPECT_EQ(needs("/runs", {{"robot_id", "r1"}, {"name", "wet"}, {"fluid", "water"}}), "operator");
  EXPECT_EQ(needs("/runs/1/annotate", {{"fluid", "water"}}), "operator");
  standing->end();
  scopes = identity::Scopes::of(identity::Role::admin);
  EXPECT_EQ(needs("/robots/r1/commands", {{"kind", "ping"}}), nullptr) << "it was revoked";
}

// It moves nothing: everybody with the scope may ask whether the robot is there, also while another actor controls it.
TEST_F(RightsTest, APingNeedsTheScopeCommandAndNoControl) {
  connect_robot();
  ASSERT_TRUE(station.control({"r1", "user:anna/session:4", "", station::ControlAction::take, 60s, ""}));
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/commands", {{"kind", "ping"}}).parsed()["needs"], "operator");
  scopes = identity::Scopes::of(identity::Role::operator_);
  const auto asked = begin("POST", "/api/v1/robots/r1/commands", {{"kind", "ping"}});
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
  EXPECT_EQ(end(asked).status, 200);
  EXPECT_EQ(station.holder("r1"), "user:anna/session:4");
}

TEST_F(RightsTest, OnlyAnAdminChangesWhatBoundsTheMotionOfARobot) {
  connect_robot();
  const auto set = [this](const char* name, json confirm) {
    json body{{"kind", "set_parameter"}, {"name", name}, {"value", 0.2}};
    if (!confirm.is_null()) body["confirm"] = std::move(confirm);
    return begin("POST", "/api/v1/robots/r1/commands", body);
  };
  scopes = identity::parse_scopes("command").value();
  const auto refused = end(set("position_limit_max_m", true));
  EXPECT_EQ(refused.status, 403);
  EXPECT_TRUE(robot->commands().empty());
  const auto of_operators = set("model_gain_error", nullptr);
  ASSERT_EQ(robot->commands().size(), 1U);
  EXPECT_STREQ(robot->commands().back().action.set_parameter.name, "model_gain_error");
  EXPECT_EQ(robot->commands().back().action.set_parameter.value, 0.2F);
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, 0);
  EXPECT_EQ(end(of_operators).status, 200);
  scopes = identity::parse_scopes("admin").value();
  EXPECT_EQ(end(set("position_limit_max_m", nullptr)).status, 422);
  const auto of_admins = set("position_limit_max_m", true);
  ASSERT_EQ(robot->commands().size(), 2U);
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, 0);
  EXPECT_EQ(end(of_admins).status, 200);
}

// Written out, as a red button has it.
TEST_F(RightsTest, ATokenThatMayOnlyStopSeesWhatItsStopIsAboutAndNothingElse) {
  connect_robot();
  const auto stopping = begin("POST", "/api/v1/robots/r1/emergency-stop");
  scopes = identity::parse_scopes("stop").value();
  std::set<std::string> open;
  for (const http::Route& route : router().routes()) {
    if (route.needs != identity::Scope::anyone && !refused(route)) open.insert(route.method + " " + route.pattern);
  }
  EXPECT_EQ(open,
            (std::set<std::string>{
                "GET /api/v1/robots", "GET /api/v1/robots/{robot_id}", "GET /api/v1/commands/{command_id}",
                "POST /api/v1/emergency-stop", "POST /api/v1/experiments/{experiment_id}/abort",
                "POST /api/v1/experiments/{experiment_id}/pause", "POST /api/v1/robots/{robot_id}/emergency-stop"}));
  const json robot_seen = ask("GET", "/api/v1/robots/r1").parsed();
  std::set<std::string> members;
  for (const auto& [member, value] : robot_seen.items()) members.insert(member);
  EXPECT_EQ(members,
            (std::set<std::string>{"robot_id", "link", "mode", "emergency_id", "emergency_cause", "pending_stop"}));
  EXPECT_EQ(ask("GET", "/api/v1/robots").parsed()["robots"], json::array({robot_seen}));
  EXPECT_EQ(robot_seen["link"], "connected");
  EXPECT_TRUE(robot_seen["pending_stop"].is_string());
}

TEST_F(RightsTest, ATokenThatMayOnlyStopSeesWhatBecameOfItsStops) {
  connect_robot();
  const auto answer_last = [this](std::uint64_t emergency_id) {
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, emergency_id);
  };
  const auto seen = [this](const std::string& id) { return ask("GET", "/api/v1/commands/" + id); };
  const auto setting = begin("POST", "/api/v1/robots/r1/commands", {{"kind", "set_duty"}, {"duty", 0.1}});
  answer_last(0);
  const std::string duty = end(setting).parsed()["command_id"];
  scopes = identity::parse_scopes("stop").value();
  const auto stopping = begin("POST", "/api/v1/robots/r1/emergency-stop");
  const std::string pending = ask("GET", "/api/v1/robots/r1").parsed()["pending_stop"];
  EXPECT_EQ(seen(pending).parsed()["state"], "sent");
  answer_last(9);
  EXPECT_EQ(end(stopping).status, 200);
  EXPECT_EQ(seen(pending).parsed()["state"], "acknowledged");
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["emergency_id"], "9");
  EXPECT_EQ(seen(duty).status, 403) << "no stop";

  station::StopRequest of_another;
  of_another.robot_id = "r1";
  of_another.actor = "token:other";
  const auto stop_as_another = [](station::Station& of, station::StopRequest request) -> boost::asio::awaitable<void> {
    co_await of.emergency_stop(std::move(request), 1s);
  };
  tasks.spawn("another's stop", stop_as_another(station, of_another));
  clock.settle();
  const std::string others = ask("GET", "/api/v1/robots/r1").parsed()["pending_stop"];
  EXPECT_EQ(seen(others).status, 200) << "it would be the answer to a stop of this token, too";
  answer_last(10);
  clock.settle();
  EXPECT_EQ(seen(others).status, 403);
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(seen(others).parsed()["actor"], "token:other");
}

TEST_F(RightsTest, AViewerSeesWhoIsInControl) {
  connect_robot();
  ASSERT_TRUE(station.control({"r1", "user:anna/session:4", "", station::ControlAction::take, 60s, ""}));
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["control"]["holder"], "user:anna/session:4");
}

TEST_F(RightsTest, EachScopeBringsAlongWhatItMust) {
  const auto with = [](identity::Scope scope) {
    identity::Scopes scopes;
    return text(scopes.add(scope));
  };
  EXPECT_EQ(with(identity::Scope::read), "read");
  EXPECT_EQ(with(identity::Scope::stop), "stop");
  EXPECT_EQ(with(identity::Scope::record), "read,record");
  EXPECT_EQ(with(identity::Scope::command), "read,stop,command") << "who may move a robot may stop it";
  EXPECT_EQ(with(identity::Scope::admin), "read,stop,record,command,admin");
  for (const identity::Role role : identity::kRoles) {
    EXPECT_TRUE(identity::Scopes::of(role).allow(identity::Scope::stop)) << text(role);
    EXPECT_EQ(identity::Scopes::of(role).role(), role);
    EXPECT_EQ(identity::parse_role(text(role)).value(), role);
    EXPECT_EQ(identity::parse_scopes(text(identity::Scopes::of(role))).value(), identity::Scopes::of(role));
  }
  for (const char* wrong : {"", "read,", "Read", "read stop", "anyone", "root"}) {
    EXPECT_FALSE(identity::parse_scopes(wrong)) << wrong;
    EXPECT_FALSE(identity::parse_role(wrong)) << wrong;
  }
}

TEST_F(RightsTest, ATokenOfAUserIsBoundByTheUsersRole) {
  identity::Accounts& accounts = ApiTest::accounts();
  std::optional<Result<identity::User>> added;
  std::optional<Result<identity::NewToken>> made;
  const auto make = [](identity::Accounts& in, std::optional<Result<identity::User>>& user,
                       std::optional<Result<identity::NewToken>>& token) -> boost::asio::awaitable<void> {
    identity::User anna;
    anna.name = "anna";
    anna.role = identity::Role::operator_;
    const station::Author nobody;
    user = co_await in.add_user(anna, nobody);
    identity::Scopes all = identity::Scopes::of(identity::Role::admin);
    identity::TokenRequest request{"all", all, 0, "anna"};
    token = co_await in.add_token(request, nobody);
  };
  tasks.spawn("make", make(accounts, added, made));
  ASSERT_TRUE(clock.run_until([&] { return made.has_value(); }, 10s));
  ASSERT_TRUE(*made);
  EXPECT_EQ(accounts.caller_of_token((*made)->secret)->role(), identity::Role::operator_);
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/change", {{"role", "viewer"}}).status, 200);
  EXPECT_EQ(accounts.caller_of_token((*made)->secret)->role(), identity::Role::viewer);
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/change", {{"disabled", true}}).status, 200);
  EXPECT_FALSE(accounts.caller_of_token((*made)->secret));
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/remove").status, 200);
  EXPECT_FALSE(accounts.caller_of_token((*made)->secret));
  EXPECT_NE(accounts.tokens().at(0).revoked_at_us, 0);
}

}  // namespace
}  // namespace server
