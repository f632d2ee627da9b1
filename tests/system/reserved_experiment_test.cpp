// SAFETY: experiments and reservations: nothing begins in, or runs into, the slot of somebody else, and the robot is at
// rest when it begins.
#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;

constexpr const char* kLongAuto = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 30";
constexpr const char* kLongManual = "kind = \"duty\"\nduty = 0.2\nfor_s = 30";
constexpr const char* kShort = "kind = \"rest\"\nfor_s = 1";

class ReservedExperimentTest : public ExperimentTest {
 protected:
  explicit ReservedExperimentTest(bool allow_unattended = false) : ExperimentTest{allow_unattended} {
    begin();
    tasks.spawn("control", station.watch_control());
  }
  void reserve(const std::string& holder, microseconds in, microseconds lasts = 1h) {
    station::Reservation made;
    made.id = ++last_id_;
    made.robot_id = "sim-1";
    made.holder = holder;
    made.from_us = clock.utc_us() + in.count();
    made.until_us = made.from_us + lasts.count();
    station.add_reservation(made);
  }
  double duty() const { return robot->simulated().motor_duty(); }

  station::ReservationId last_id_ = 0;
};

TEST_F(ReservedExperimentTest, OfSomebodyWhoIsKeptOutWaitsAndLetsOthersGo) {
  come("anna");
  come("boris");
  reserve("boris", 0s, 60s);
  const auto of_anna = enqueue(profile({kShort}), "anna");
  EXPECT_EQ(view(of_anna).waits_for, "reserved");
  EXPECT_NE(view(of_anna).waits_for_detail.find("boris"), std::string::npos);
  const auto of_boris = enqueue(profile({kShort}), "boris");
  until(of_boris, ExperimentState::done);
  EXPECT_EQ(view(of_anna).waits_for, "reserved");
  leave("boris");  // and lets go of the robot
  until(of_anna, ExperimentState::done, 90s);
}

TEST_F(ReservedExperimentTest, OneThatWouldRunIntoASlotWaitsAndAShorterOneGoesFirst) {
  come("anna");
  reserve("boris", 25s, 20s);
  const auto too_long = enqueue(profile({kLongAuto}), "anna");
  EXPECT_EQ(view(too_long).waits_for, "reserved_soon");
  EXPECT_NE(view(too_long).waits_for_detail.find("it lasts 3"), std::string::npos) << view(too_long).waits_for_detail;
  const auto fits = enqueue(profile({kShort}), "anna");
  until(fits, ExperimentState::done, 20s);
  EXPECT_EQ(view(too_long).waits_for, "reserved_soon");
  EXPECT_TRUE(clock.run_until([&] { return view(too_long).waits_for == "reserved"; }, 25s));
  until(too_long, ExperimentState::running, 30s);
}

TEST_F(ReservedExperimentTest, OneThatRunsIsAbortedAndItsRobotAtRestBeforeTheSlotBegins) {
  const auto id = start(profile({kLongAuto}));
  reserve("boris", 12s);
  const auto waits = enqueue(profile({kShort}), "anna");
  clock.run_for(6s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
  clock.run_for(6s);  // the slot begins now
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  EXPECT_EQ(duty(), 0);
  EXPECT_FALSE(state().latched()) << "brought to rest, not stopped";
  expect_aborted(id, "reserved");
  EXPECT_EQ(view(waits).waits_for, "reserved") << "it is somebody else's turn; nothing was wrong";
}

// An administrator reserves it from now on: its actor may command the robot no more, and it comes to rest all the same.
TEST_F(ReservedExperimentTest, InTheSlotOfSomebodyElseTheRobotIsBroughtToRestByTheStation) {
  for (const char* step : {kLongAuto, kLongManual}) {
    const auto id = start(profile({step}));
    clock.run_for(2s);
    ASSERT_NE(duty(), 0);
    reserve("boris", 0s, 20s);
    EXPECT_EQ(view(id).experiment.state, ExperimentState::aborting) << "at once";
    EXPECT_EQ(command_by("anna", sim_robot::set_setpoint(0.2F)).error().reason, "reserved");
    ASSERT_TRUE(clock.run_until([&] { return duty() == 0 && state().context.mode == rheonaut_MODE_MANUAL; }, 2s));
    expect_aborted(id, "reserved");
    EXPECT_FALSE(state().latched()) << "SAFETY: by set_mode, long before the emergency stop of one that does not obey";
    clock.run_for(20s);
  }
}

TEST_F(ReservedExperimentTest, WhoeverReservedItAndControlsItIsResponsible) {
  const auto id = start(profile({kLongAuto}));
  reserve("boris", 0s);
  ASSERT_TRUE(control_by("boris", station::ControlAction::take));
  const storage::Experiment ended = until(id, ExperimentState::aborted, 10s);
  EXPECT_EQ(ended.reason, "reserved");
  EXPECT_EQ(station.holder("sim-1"), "boris");
}

TEST_F(ReservedExperimentTest, IsTakenOverByNobodyWhoIsKeptOut) {
  come("boris");
  const auto id = enqueue(profile({kShort}), "carl");
  reserve("carl", 0s, 30s);
  EXPECT_EQ(wait_for(experiments->take_over(id, {"boris", "", 0})).error().reason, "reserved");
  EXPECT_EQ(view(id).experiment.acts_for, "carl");
  clock.run_for(30s);
  EXPECT_TRUE(wait_for(experiments->take_over(id, {"boris", "", 0})));
}

TEST_F(ReservedExperimentTest, AnAdministratorsForceBeginsOneInTheSlotOfSomebodyElse) {
  reserve("boris", 0s);
  ASSERT_TRUE(control_by("root", station::ControlAction::force));
  const auto id = start(profile({"kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 3"}), "root");
  until(id, ExperimentState::done);
}

class ReservedUnattendedTest : public ReservedExperimentTest {
 protected:
  ReservedUnattendedTest() : ReservedExperimentTest{true} {}
};

TEST_F(ReservedUnattendedTest, OneThatIsAloneIsAbortedToo) {
  come("anna");
  const auto begun = try_to_begin(profile({kLongAuto}, "unattended = true\n"), "anna", true);
  ASSERT_TRUE(begun) << begun.error().detail;
  const auto id = begun->experiment.id;
  until(id, ExperimentState::running);
  ASSERT_TRUE(clock.run_until([&] { return duty() != 0; }, 20s));
  leave("anna");
  reserve("boris", 10s);
  clock.run_for(10s);
  EXPECT_EQ(duty(), 0);
  expect_aborted(id, "reserved");
}

}  // namespace
}  // namespace server
