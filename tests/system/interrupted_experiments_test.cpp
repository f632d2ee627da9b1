// An experiment whose link, command, samples or client were late: the robot rests, and it goes on where it was broken
// off; or it does not, where it must not.
#include <cstdlib>
#include <random>

#include "server/experiments/profile_document.hpp"
#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;

constexpr const char* kDuty = "kind = \"duty\"\nduty = 0.2\nfor_s = 8";
constexpr const char* kSetpoint = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 8";

class InterruptedTest : public ExperimentTest {
 protected:
  InterruptedTest() { begin(); }

  double duty() const { return robot->simulated().motor_duty(); }
  void lose_link(microseconds for_us) {
    robot->redial = false;
    robot->cut();
    clock.run_for(for_us);
    robot->redial = true;
    if (!robot->connected()) robot->dial(*listener);
  }
  // It is interrupted, and the robot rests.
  void expect_interrupted(storage::ExperimentId id, const std::string& reason) {
    ASSERT_TRUE(clock.run_until([&] { return view(id).experiment.state == ExperimentState::paused; }, 3s));
    EXPECT_EQ(view(id).experiment.reason, reason) << view(id).experiment.detail;
    ASSERT_TRUE(clock.run_until([&] { return duty() == 0; }, 2s));
  }
  std::size_t driven(storage::ExperimentId id) {
    const auto is_driven = [](const storage::StoredSample& one) { return one.sample.duty != 0; };
    return static_cast<std::size_t>(std::ranges::count_if(samples_of_first_run(id), is_driven));
  }
  static std::string shipped(const std::string& name) {
    const auto found = std::ranges::find(shipped_profiles(), name, &base::EmbeddedFile::name);
    return std::string{found->content};
  }
  std::size_t begins(storage::ExperimentId id) {
    return nlohmann::json::parse(view(id).experiment.runs.at(0).steps).size();
  }
};

TEST_F(InterruptedTest, ADutyGoesOnWhereALostLinkBrokeItOff) {
  const auto id = start(profile({kDuty}));
  clock.run_for(3s);
  lose_link(1400ms);
  expect_interrupted(id, "link_lost");
  clock.run_for(1500ms);
  EXPECT_NE(view(id).experiment.detail.find("the link to the robot was away for 1."), std::string::npos)
      << view(id).experiment.detail;
  EXPECT_NE(view(id).experiment.detail.find("it goes on in"), std::string::npos) << view(id).experiment.detail;
  until(id, ExperimentState::done);
  EXPECT_EQ(begins(id), 1U);
  EXPECT_NEAR(static_cast<double>(driven(id)), 800, 20);
}

TEST_F(InterruptedTest, AClosedLoopStepBeginsAgain) {
  const auto id = start(profile({kSetpoint}));
  clock.run_for(3s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  until(id, ExperimentState::done);
  EXPECT_EQ(begins(id), 2U);
}

TEST_F(InterruptedTest, ALinkThatIsSilentForAMomentIsNoEnd) {
  for (const auto silent : {600ms, 1200ms, 2500ms}) {
    const auto id = start(profile({kDuty}));
    clock.run_for(2s);
    robot->stall(true);
    clock.run_for(silent);
    robot->stall(false);
    until(id, ExperimentState::done);
    EXPECT_NEAR(static_cast<double>(driven(id)), 800, 60) << silent.count();
  }
}

TEST_F(InterruptedTest, ALinkThatStaysAwayEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  robot->redial = false;
  robot->cut();
  const auto ended = until(id, ExperimentState::aborted, 60s);
  EXPECT_EQ(ended.reason, "link_lost");
  EXPECT_EQ(duty(), 0);
}

TEST_F(InterruptedTest, ABootEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  switch_off_and_on();
  expect_aborted(id, "reboot");
}

TEST_F(InterruptedTest, AStopEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  send(sim_robot::emergency_stop());
  const auto ended = until(id, ExperimentState::aborted);
  EXPECT_EQ(ended.reason, "emergency_stop");
  clock.run_for(10s);
  EXPECT_EQ(duty(), 0);
}

TEST_F(InterruptedTest, APauseInTheCountDownHoldsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  ASSERT_TRUE(
      clock.run_until([&] { return view(id).experiment.detail.find("it goes on in") != std::string::npos; }, 5s));
  clock.run_for(1s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(20s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "requested");
  EXPECT_EQ(duty(), 0);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
  EXPECT_NEAR(static_cast<double>(driven(id)), 800, 20);
}

// SAFETY: a sign of life from before the robot was seen at rest counts for nothing.
TEST_F(InterruptedTest, NothingGoesOnForAClientWhoIsNotThere) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  leave("anna");
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  expect_aborted(id, "link_lost", 20s);
}

TEST_F(InterruptedTest, AClientThatIsBackWithinTenSecondsGoesOn) {
  const auto id = start(profile({kSetpoint}));
  clock.run_for(2s);
  leave("anna");
  ASSERT_TRUE(clock.run_until([&] { return view(id).experiment.state == ExperimentState::paused; }, 5s));
  clock.run_for(6s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  come("anna");
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL) << "the count-down";
  until(id, ExperimentState::done);
}

TEST_F(InterruptedTest, NothingGoesOnWhenControlWasTaken) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  come("boris");
  ASSERT_TRUE(control_by("boris", station::ControlAction::force));
  until(id, ExperimentState::aborted, 80s);
  EXPECT_EQ(station.holder("sim-1"), "boris");
  EXPECT_EQ(duty(), 0);
}

// SAFETY: and does so by itself no more when who has taken it lets it go.
TEST_F(InterruptedTest, NothingGoesOnWhenControlWasTakenAndLetGo) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  ASSERT_TRUE(control_by("boris", station::ControlAction::force));
  clock.run_for(200ms);
  ASSERT_TRUE(control_by("boris", station::ControlAction::release));
  clock.run_for(15s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "control_changed");
  EXPECT_EQ(duty(), 0);
}

TEST_F(InterruptedTest, WhoGivesControlUpEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  ASSERT_TRUE(control_by("anna", station::ControlAction::release));
  expect_aborted(id, "control_changed");
}

TEST_F(InterruptedTest, WhoResumesItWhileTheLinkIsAwayIsAskedAgain) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(1s);
  robot->redial = false;
  robot->cut();
  clock.run_for(1s);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  clock.run_for(20s);
  robot->redial = true;
  robot->dial(*listener);
  clock.run_for(10s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(duty(), 0);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
}

// With the duty that is in force where it is broken off.
TEST_F(InterruptedTest, WhatIsLeftKeepsWithinTheLimits) {
  const auto id = start(profile({"kind = \"duty\"\nduty = 0.3\nfor_s = 30"}, "[limits]\nposition_max_m = 0.4\n"));
  clock.run_for(2s);
  EXPECT_LT(robot->simulated().world().position_m(), 0.3);
  lose_link(700ms);
  expect_aborted(id, "no_room");
  EXPECT_LT(robot->simulated().world().position_m(), 0.35);
}

TEST_F(InterruptedTest, AClosedLoopStepBeginsFiveTimes) {
  const auto id = start(profile({"kind = \"setpoint\"\nsetpoint_m = 0.05\nfor_s = 60"}));
  for (int begun = 1; begun < 5; ++begun) {
    clock.run_for(2s);
    lose_link(300ms);
    expect_interrupted(id, "link_lost");
    until(id, ExperimentState::running, 20s);
  }
  clock.run_for(2s);
  lose_link(300ms);
  expect_aborted(id, "too_many_repeats", 20s);
}

TEST_F(InterruptedTest, InterruptionsLastNoLongerThanTheRun) {
  const auto id = start(profile({"kind = \"duty\"\nduty = 0.1\nfor_s = 9"}));
  for (int k = 0; k < 3 && view(id).experiment.state == ExperimentState::running; ++k) {
    clock.run_for(1s);
    lose_link(5s);
    clock.run_for(6s);
  }
  expect_aborted(id, "too_many_repeats", 20s);
}

TEST_F(InterruptedTest, BeforeARunItWaitsForTheLink) {
  come("anna");
  const auto id = enqueue(profile({kDuty}, "[sweep]\nrepeats = 2\n"));
  until(id, ExperimentState::running);
  lose_link(1500ms);  // it is being prepared
  until(id, ExperimentState::done, 120s);
}

// Ten outages of 0.2 to 3 s at any moment of the profile that a fit needs: deploy says how many seeds.
TEST_F(InterruptedTest, AnIdentificationSurvivesTenOutages) {
  const char* given = std::getenv("RHEONAUT_OUTAGE_SEEDS");
  const int seeds = given == nullptr ? 1 : std::stoi(given);
  int done = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::uniform_int_distribution<int> between_ms(1000, 18'000), away_ms(200, 3000);
    const auto id = start(shipped("identification_set"));
    for (int outage = 0; outage < 10; ++outage) {
      clock.run_for(std::chrono::milliseconds(between_ms(random)));
      if (random() % 2 == 0) {
        lose_link(std::chrono::milliseconds(away_ms(random)));
      } else {
        robot->stall(true);
        clock.run_for(std::chrono::milliseconds(away_ms(random)));
        robot->stall(false);
      }
    }
    clock.run_until([&] { return storage::has_ended(view(id).experiment.state); }, 1000s);
    const auto ended = view(id).experiment;
    done += ended.state == ExperimentState::done ? 1 : 0;
    if (ended.state != ExperimentState::done)
      std::printf("seed %d: %s: %s\n", seed, ended.reason.c_str(), ended.detail.c_str());
  }
  EXPECT_GE(done * 20, seeds * 19);
}

}  // namespace
}  // namespace server
