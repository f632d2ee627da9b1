// The steps of a commissioning, in their order:
//
//   versions         what the robot and the station say of themselves
//   stop_latency     SAFETY: before the motor ever runs; a stop that is not confirmed ends it there
//   imu_noise, electrode                  at rest
//   motor_direction, imu_axis, dead_zone  pushes, the smallest duty first, and one that a person watches
//   motor_constant   a recorded step; only where motor and axis are right
//   free_travel      the robot's limits beside the length that the person measured
// Whatever ends it before its end (Ctrl-C, a refusal, a lost station, a person who says no) ends in an emergency stop
// of the robot, once its stops have begun.
#pragma once

#include <string>

#include "server/cli/commission/person.hpp"
#include "server/cli/commission/plan.hpp"
#include "server/cli/commission/record.hpp"
#include "server/cli/commission/robot_access.hpp"
#include "server/cli/commission/standstill.hpp"
#include "server/cli/commission/travel.hpp"

namespace server::cli {

class Commissioning {
 public:
  Commissioning(RobotAccess& robot, Person& person, CommissionPlan plan, CommissionRecord& record)
      : robot_{robot}, person_{person}, plan_{plan}, record_{record} {}

  // Fills the record. Throws std::runtime_error only before anything was done to the robot. Control of the robot is
  // taken once its way is known to be long enough, and given back at every end.
  void run();

 private:
  void look_at_robot();  // throws when it cannot begin
  void ask_for_room();   // throws when there is too little
  void perform();
  void prove_stops();  // throws when one is not confirmed, or not reset
  void stop_and_reset();
  void measure_at_rest();
  void push();
  void find_direction();
  void judge_pushes();
  StepFinding set_dead_zone(const DeadZoneToSet& zone, StepFinding found);
  void find_motor_constant();
  void judge_travel();
  void end_early(const std::string& why);
  void complete();  // what was not reached

  RecordedRun record_run(const nlohmann::json& profile);
  void add(StepFinding finding);

  RobotAccess& robot_;
  Person& person_;
  CommissionPlan plan_;
  CommissionRecord& record_;
  nlohmann::json parameters_;
  StopFacts stops_;
  RestFacts rest_;
  DeadZoneFacts dead_zone_;
  DirectionFacts direction_;
  MotorFacts motor_;
  TravelFacts travel_;
  RecordedSample last_end_{.position_sd_m = 0};  // of the run before; before the first it lies where the ruler does
};

}  // namespace server::cli
