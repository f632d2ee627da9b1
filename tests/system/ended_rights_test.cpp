// SAFETY: when a right ends, what moves in its name ends: every way in which it ends, with everything that goes on
// after a request. Who is only away leaves what goes on without them.
#include <functional>

#include "tests/system/ended_rights_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;
using identity::Role;
using storage::ExperimentId;

constexpr const char* kTurn = "kind = \"duty\"\nduty = 0.2\nfor_s = 30";
constexpr const char* kGo = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 30";

struct Way {
  const char* name;
  std::function<std::string(EndedRightsTest&)> actor;
  std::function<void(EndedRightsTest&, const std::string& actor)> happens;
};

std::string user_of(const std::string& actor) { return actor.substr(5, actor.find('/') - 5); }
std::string owner_of(EndedRightsTest& test, const std::string& actor) {
  return test.accounts.account_of(actor).substr(std::string_view{"user:"}.size());
}

identity::UserChange to_role(Role role) { return {role, {}, {}}; }
const identity::UserChange kDisable{{}, {}, true}, kNewPassword{{}, "another", {}};

std::string token_of_a_user(EndedRightsTest& test) { return test.token(test.new_user()); }
std::string page_of_a_user(EndedRightsTest& test) { return test.page(test.new_user()); }
std::string page_of_a_link(EndedRightsTest& test) { return test.page(""); }

const std::vector<Way>& losses() {
  static const std::vector<Way> ways{
      {"a token is revoked", [](EndedRightsTest& test) { return test.token(); },
       [](EndedRightsTest& test, const std::string& actor) {
         EXPECT_TRUE(test.wait_for(test.accounts.revoke_token(actor.substr(6), test.admin())));
       }},
      {"a token expires",
       [](EndedRightsTest& test) {
         const std::string actor = test.token("", 1);
         test.clock.step_utc(test.left_of_token() - 15s);
         return actor;
       },
       [](EndedRightsTest& test, const std::string&) { test.clock.run_for(test.left_of_token()); }},
      {"the owner of a token is disabled", token_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         test.change(owner_of(test, actor), kDisable, test.admin());
       }},
      {"the owner of a token is removed", token_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         EXPECT_TRUE(test.wait_for(test.accounts.remove_user(owner_of(test, actor), test.admin())));
       }},
      {"the owner of a token becomes a viewer", token_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         test.change(owner_of(test, actor), to_role(Role::viewer), test.admin());
       }},
      {"a user is disabled", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) { test.change(user_of(actor), kDisable, test.admin()); }},
      {"a user is removed", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         EXPECT_TRUE(test.wait_for(test.accounts.remove_user(user_of(actor), test.admin())));
       }},
      {"a user becomes a viewer", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         test.change(user_of(actor), to_role(Role::viewer), test.admin());
       }},
      {"an administrator sets the password", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         test.change(user_of(actor), kNewPassword, test.admin());
       }},
      {"an administrator ends the session", page_of_a_user,
       [](EndedRightsTest& test, const std::string&) {
         EXPECT_TRUE(test.wait_for(test.accounts.end_session(test.session(), test.admin())));
       }},
      {"an administrator ends the session of a link", page_of_a_link,
       [](EndedRightsTest& test, const std::string&) {
         EXPECT_TRUE(test.wait_for(test.accounts.end_session(test.session(), test.admin())));
       }},
      {"a user who has signed out is disabled", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         EXPECT_TRUE(test.wait_for(test.accounts.end_session(test.session(), test.by(actor))));
         test.change(user_of(actor), kDisable, test.admin());
       }},
  };
  return ways;
}

const std::vector<Way>& absences() {
  static const std::vector<Way> ways{
      {"signs out", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         EXPECT_TRUE(test.wait_for(test.accounts.end_session(test.session(), test.by(actor))));
       }},
      {"ends their own session from another page", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         EXPECT_TRUE(test.wait_for(
             test.accounts.end_session(test.session(), test.by("user:" + user_of(actor) + "/session:999"))));
       }},
      {"changes their own password", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         test.change(user_of(actor), kNewPassword, test.by(actor));
       }},
      {"becomes an administrator", page_of_a_user,
       [](EndedRightsTest& test, const std::string& actor) {
         test.change(user_of(actor), to_role(Role::admin), test.admin());
       }},
      {"has their session run out", page_of_a_user,
       [](EndedRightsTest& test, const std::string&) { test.clock.step_utc(13h); }},
      {"is not who loses a right", page_of_a_user,
       [](EndedRightsTest& test, const std::string&) {
         const std::string other = test.page(test.new_user());
         test.change(user_of(other), kDisable, test.admin());
       }},
  };
  return ways;
}

struct Thing {
  const char* name;
  std::function<void(EndedRightsTest&, const std::string& actor)> begins;
  bool moves = true;
};

void PrintTo(const Thing& thing, std::ostream* out) { *out << thing.name; }

protocol::Command schedule() {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_duty_schedule_tag;
  rheonaut_SetDutySchedule& entries = command.action.set_duty_schedule;
  entries.tick_count = entries.duty_count = 2;
  entries.tick[0] = 0;
  entries.duty[0] = 0.2F;
  entries.tick[1] = 3000;
  entries.duty[1] = 0;
  return command;
}

const std::vector<Thing> kThings{
    {"an_experiment_with_a_duty", [](EndedRightsTest& test, const std::string& actor) { test.start_by(actor, kTurn); }},
    {"an_experiment_in_auto", [](EndedRightsTest& test, const std::string& actor) { test.start_by(actor, kGo); }},
    {"an_unattended_experiment",
     [](EndedRightsTest& test, const std::string& actor) { test.start_by(actor, kGo, true); }},
    {"a_paused_experiment",
     [](EndedRightsTest& test, const std::string& actor) {
       test.start_by(actor, kGo);
       EXPECT_TRUE(test.wait_for(test.experiments->pause(test.experiment, test.admin())));
       test.clock.run_for(2s);
     },
     false},
    {"a_waiting_experiment",
     [](EndedRightsTest& test, const std::string& actor) { test.experiment = test.begin_by(actor, kTurn); }, false},
    {"a_held_duty",
     [](EndedRightsTest& test, const std::string& actor) { test.send(actor, sim_robot::set_duty(0.2F), 100ms); }},
    {"a_schedule", [](EndedRightsTest& test, const std::string& actor) { test.send(actor, schedule(), 100ms); }},
    {"a_setpoint",
     [](EndedRightsTest& test, const std::string& actor) { test.send(actor, sim_robot::set_auto(0.1F)); }},
    {"auto_whose_control_has_lapsed",
     [](EndedRightsTest& test, const std::string& actor) {
       test.send(actor, sim_robot::set_auto(0.1F));
       test.clock.run_for(4s);
       EXPECT_EQ(test.station.holder("sim-1"), "");
     }},
    {"a_timed_command",
     [](EndedRightsTest& test, const std::string& actor) {
       const std::uint64_t soon = test.station.find("sim-1")->latest_robot_time_us + 400'000;  // its lease is of 500 ms
       test.send(actor, sim_robot::timed(sim_robot::set_auto(0.1F), soon), 100ms);
     },
     false},
    {"control",
     [](EndedRightsTest& test, const std::string& actor) {
       EXPECT_TRUE(test.control_by(actor, station::ControlAction::take));
     },
     false},
};

class EndedRightsOfTest : public EndedRightsTest, public ::testing::WithParamInterface<Thing> {};

TEST_P(EndedRightsOfTest, EndWhateverWayTheyEnd) {
  for (const Way& way : losses()) {
    SCOPED_TRACE(way.name);
    const std::string actor = way.actor(*this);
    experiment = 0;
    GetParam().begins(*this, actor);
    ASSERT_EQ(is_at_rest(), !GetParam().moves);
    way.happens(*this, actor);  // their signs of life go on
    clock.run_for(200ms);
    EXPECT_TRUE(is_at_rest()) << "duty " << duty();
    EXPECT_NE(station.holder("sim-1"), actor);
    const std::ptrdiff_t told = told_by(actor);
    clock.run_for(6s);
    EXPECT_TRUE(is_at_rest()) << "duty " << duty();
    EXPECT_EQ(told_by(actor), told) << "nothing is done in that name any more";
    if (experiment != 0) {
      const storage::Experiment ended = view(experiment).experiment;
      EXPECT_EQ(ended.state, GetParam().name == std::string{"a_waiting_experiment"} ? ExperimentState::cancelled
                                                                                    : ExperimentState::aborted);
      EXPECT_EQ(ended.reason, "right_ended") << ended.detail;
      EXPECT_FALSE(ended.detail.empty());
    }
    leave(actor);
    clock.run_for(4s);
  }
}

INSTANTIATE_TEST_SUITE_P(Things, EndedRightsOfTest, ::testing::ValuesIn(kThings),
                         [](const auto& test) { return std::string{test.param.name}; });

// It ends as if they were silent, and an unattended one goes on.
TEST_F(EndedRightsTest, WhoIsOnlyAwayLeavesGoingOnWhatNeedsNobody) {
  for (const Way& way : absences()) {
    SCOPED_TRACE(way.name);
    const std::string actor = way.actor(*this);
    start_by(actor, kGo, true);
    way.happens(*this, actor);
    clock.run_for(5s);
    EXPECT_EQ(view(experiment).experiment.state, ExperimentState::running) << view(experiment).experiment.detail;
    EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO);
    EXPECT_TRUE(wait_for(experiments->abort(experiment, "", admin())));
    clock.run_for(5s);
    send(actor, sim_robot::set_auto(0.05F));
    way.happens(*this, way.actor(*this));  // of somebody else, by the time
    clock.run_for(4s);
    EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO) << "a setpoint goes on to auto_limit_s";
    send("token:local", sim_robot::set_manual());
    clock.run_for(5s);
  }
}

TEST_F(EndedRightsTest, ARightThatIsNarrowerAndEnoughEndsNothing) {
  const std::string user = new_user(Role::admin);
  const std::string actor = page(user);
  start_by(actor, kGo, true);
  change(user, to_role(Role::operator_), admin());
  clock.run_for(2s);
  EXPECT_EQ(view(experiment).experiment.state, ExperimentState::running);
}

}  // namespace
}  // namespace server
