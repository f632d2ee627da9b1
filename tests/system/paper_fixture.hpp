// A station with all of its routes, and one simulated robot of which the test knows where it really is.
//
// Everything is asked of the station by its routes, as a script does: experiments, jobs, designs, fluids, reports. The
// robot is the real core in a simulated world; a person who puts it into another fluid switches it off meanwhile, so
// that it boots there, with what its board keeps.
#pragma once

#include <gmock/gmock.h>

#include "control/responses/step_metrics.hpp"
#include "tests/robot_fw/memory_storage.hpp"
#include "tests/server/api/api_fixture.hpp"
#include "tests/system/virtual_robot.hpp"

namespace server {

// Where the robot was in the simulated world, tick by tick of one boot.
struct TrueMotion {
  std::vector<std::uint64_t> robot_time_us;
  std::vector<double> position_m;

  double at(std::uint64_t time_us) const;
};

// A step of a run on the true position, which counts from where the robot was when its position became zero.
struct TrueStep {
  control::StepMetrics measured;
  control::StepMetrics around_end;  // the same with where it was at the end as its target
  std::vector<double> position_m;   // from the tick of the step on
};

class PaperTest : public ApiTest {
 public:
  ~PaperTest() override {
    tasks.stop();  // the robots outlive their tasks
    clock.settle();
  }

 protected:
  static constexpr const char* kRobot = "/api/v1/robots/sim-1";
  static constexpr double kSetpoint_m = 0.1, kDisturbance_m = -0.05;
  static constexpr double kBand_m = 0.02 * kSetpoint_m;  // of settling
  static constexpr double kPhase_s = 20;                 // of the paper's closed-loop experiments

  // It boots in this fluid of sim_robot, with what the board keeps.
  void boot_in(const std::string& fluid, bool has_default_sensor);
  // It boots in another one; the station learns it by the call of a person.
  void move_to(const std::string& fluid);

  json get(const std::string& target);
  json post(const std::string& target, const json& body = nullptr);
  // The result of a job that is done.
  json computed(const json& request);
  std::int64_t last_job() const { return job_id_; }

  // Names the fluid of the robot; the state of its model afterwards.
  std::string name_fluid(const std::string& fluid);

  // In the name of a script that gives its signs of life, until the state is one of these; the experiment then.
  json begin_experiment(const std::string& profile);
  json await_experiment(const json& experiment, const std::string& state);
  json perform(const std::string& profile) { return await_experiment(begin_experiment(profile), "done"); }

  // Of the last run of the experiment, while its boot lasts.
  TrueStep true_step(const json& experiment, std::size_t step);
  // Gives the station the true position of this run as the one that was measured from outside.
  void import_truth(const json& experiment);

  TrueMotion truth;
  robot_fw::MemoryStorage board;
  std::unique_ptr<VirtualRobot> swimmer;

 private:
  std::uint64_t zeroed_at_us(std::uint64_t before_us);

  std::vector<std::unique_ptr<VirtualRobot>> switched_off_;
  std::int64_t job_id_ = 0;
};

}  // namespace server
