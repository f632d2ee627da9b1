// An experiment that is interrupted: its link is lost, and the robot comes to rest.
#pragma once

#include <algorithm>
#include <string>

#include "server/experiments/profile_document.hpp"
#include "tests/system/experiment_fixture.hpp"

namespace server {

using namespace server::experiments;

class InterruptedTest : public ExperimentTest {
 protected:
  explicit InterruptedTest(sim_robot::SimulatedRobotConfig config = {}) { begin(std::move(config)); }

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
  storage::Run run_of(storage::ExperimentId id) {
    return wait_for(runs->find(view(id).experiment.runs.at(0).run.value())).value();
  }
  std::size_t begins(storage::ExperimentId id) {
    return nlohmann::json::parse(view(id).experiment.runs.at(0).steps).size();
  }
};

}  // namespace server
