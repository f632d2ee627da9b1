// SAFETY: a robot that moves in a name whose right has ended comes to rest in each moment and state that it may be in.
#include <set>

#include "tests/system/ended_rights_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;

class RestGuardsTest : public EndedRightsTest {
 protected:
  // At once, as no request by which somebody loses a right can.
  void end_right_of(const std::string& actor) {
    station.end_right({[actor](const std::string& each) { return each == actor; }, "a test"});
  }
  Rest bring(const std::string& actor) {
    return wait_for(bring_to_rest(station, clock, {"sim-1", actor, "experiment:1"}), 60s);
  }
  void lose_link() {
    robot->redial = false;
    robot->cut();
  }
  // Nobody waits for its answer.
  void order(const std::string& actor, const protocol::Command& action) {
    station::CommandRequest request;
    request.robot_id = "sim-1";
    request.action = action;
    request.actor = actor;
    tasks.spawn("an order", submit_aside(std::move(request)));
  }
  std::set<station::CommandId> commands_of(const std::string& actor) const {
    std::set<station::CommandId> ids;
    for (const station::CommandRecord& record : sink.commands) {
      if (record.actor == actor) ids.insert(record.id);
    }
    return ids;
  }

 private:
  boost::asio::awaitable<void> submit_aside(station::CommandRequest request) {
    co_await station.submit(std::move(request));
  }
};

// --- bring_to_rest() ---

TEST_F(RestGuardsTest, ASlotOfSomebodyElseKeepsNoRobotMoving) {
  send("anna", sim_robot::set_auto(0.1F));
  station::Reservation made;
  made.id = 1;
  made.robot_id = "sim-1";
  made.holder = "boris";
  made.from_us = clock.utc_us();
  made.until_us = made.from_us + microseconds{1h}.count();
  station.add_reservation(made);
  clock.run_for(200ms);
  ASSERT_EQ(state().context.mode, rheonaut_MODE_AUTO);
  ASSERT_FALSE(command_by("anna", sim_robot::set_manual())) << "it is not theirs to command";
  EXPECT_EQ(bring("anna"), Rest::at_rest);
  EXPECT_TRUE(is_at_rest());
}

TEST_F(RestGuardsTest, OneThatIsAwayForTooLongIsStoppedWhenItIsBack) {
  send("anna", sim_robot::set_auto(0.1F));
  lose_link();
  EXPECT_EQ(bring("anna"), Rest::stopped);
  robot->dial(*listener);
  EXPECT_TRUE(clock.run_until([&] { return state().context.mode == rheonaut_MODE_EMERGENCY; }, 2s));
}

// Whether its order is on its way, has come, or shows, when the robot is brought to rest in the name before.
TEST_F(RestGuardsTest, AnotherNameThatEndsMeanwhileMovesItNoLonger) {
  for (microseconds after = 20ms; after <= 300ms; after += 10ms) {
    SCOPED_TRACE(after.count());
    send("anna", sim_robot::set_auto(0.1F));
    end_right_of("anna");
    clock.run_for(after);
    order("boris", sim_robot::set_auto(0.12F));
    clock.run_for(10ms);
    end_right_of("boris");
    clock.run_for(1s);
    EXPECT_TRUE(is_at_rest());
    clock.run_for(4s);
    EXPECT_TRUE(is_at_rest());
    ASSERT_FALSE(state().latched());
  }
}

// A sample of the time at which the robot took the order does not show it, since it is made first.
TEST_F(RestGuardsTest, AnOrderThatIsAnsweredAndNotYetShownIsNoRest) {
  for (int phase_ms = 0; phase_ms < 10; ++phase_ms) {
    order("boris", sim_robot::set_auto(0.1F));
    clock.run_for(4ms);
    end_right_of("boris");
    clock.run_for(1s);
    EXPECT_TRUE(is_at_rest()) << phase_ms;
    clock.run_for(1s + std::chrono::milliseconds{phase_ms});
  }
}

// --- what is owed ---

TEST_F(RestGuardsTest, WhatARobotThatIsAwayIsOwedIsOnDisk) {
  send("anna", sim_robot::set_auto(0.1F));
  lose_link();
  clock.run_for(100ms);
  end_right_of("anna");
  clock.run_for(500ms);
  const auto rests = owed();
  ASSERT_EQ(rests.size(), 1U);
  EXPECT_EQ(rests.front().robot_id, "sim-1");
  EXPECT_EQ(rests.front().boot_id, state().boot_id);
}

TEST_F(RestGuardsTest, OneWhoseLinkBreaksMeanwhileComesToRestWhenItIsBack) {
  send("anna", sim_robot::set_auto(0.1F));
  end_right_of("anna");
  lose_link();
  clock.run_for(600ms);
  ASSERT_NE(duty(), 0) << "the order has not come";
  EXPECT_EQ(owed().size(), 1U);
  robot->dial(*listener);
  clock.run_for(1s);
  EXPECT_TRUE(is_at_rest());
  EXPECT_FALSE(state().latched());
  clock.run_for(1s);
  EXPECT_TRUE(owed().empty());
}

TEST_F(RestGuardsTest, AStopThatIsKeptTakesThePlaceOfIt) {
  send("anna", sim_robot::set_auto(0.1F));
  lose_link();
  clock.run_for(100ms);
  end_right_of("anna");
  clock.run_for(500ms);
  ASSERT_EQ(owed().size(), 1U);
  station::StopRequest stop;
  stop.robot_id = "sim-1";
  stop.actor = "boris";
  ASSERT_TRUE(wait_for(station.emergency_stop(std::move(stop), 1s)));
  clock.run_for(500ms);
  EXPECT_TRUE(owed().empty());
}

// --- in nobody's name ---

TEST_F(RestGuardsTest, AnExperimentComesToRestInNobodysName) {
  for (const char* step :
       {"kind = \"duty\"\nduty = 0.2\nfor_s = 30", "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 30"}) {
    start_by("anna", step);
    end_right_of("anna");
    const auto before = commands_of("anna");
    clock.run_for(5s);
    EXPECT_TRUE(is_at_rest());
    EXPECT_EQ(commands_of("anna"), before);
    EXPECT_EQ(view(experiment).experiment.state, ExperimentState::aborted);
    leave("anna");
    clock.run_for(4s);
  }
}

// --- who acts without a right ---

TEST_F(RestGuardsTest, ATokenWithoutTheScopeMovesNothingForLong) {
  const identity::TokenRequest request{"reader", identity::parse_scopes("read").value(), 0, ""};
  ASSERT_TRUE(wait_for(accounts.add_token(request, admin())));
  send("token:reader", sim_robot::set_auto(0.1F), 1500ms);
  EXPECT_TRUE(is_at_rest());
}

TEST_F(RestGuardsTest, WhoIsAViewerMovesNothingForLong) {
  const std::string viewer = new_user(identity::Role::viewer);
  for (const std::string& actor : {page(viewer), token(viewer)}) {
    send(actor, sim_robot::set_auto(0.1F), 1500ms);
    EXPECT_TRUE(is_at_rest()) << actor;
  }
}

}  // namespace
}  // namespace server
