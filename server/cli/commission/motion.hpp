// What is found while the motor runs: how the accelerometer answers a duty, the motor's direction, the sensor's axis,
// the dead zone, the motor constant. Facts in, a finding out: nothing here asks a robot.
//
// An edge is a change of the duty between 0 and u. The sum of the acceleration over the window that follows is the
// change of the velocity that the sensor saw; after an edge to 0 its sign is turned round. The mean over the edges of
// one duty is
//   response = mean ± noise · dt · √(window/dt) / √(number of edges)          noise: sd of a reading at rest
// A slow drift of the bias cancels between the two edges of a push.
// The motor's direction and the sensor's axis turn the response round alike, so the response alone tells neither: the
// word of the person who watches the robot separates them.
// Errors: none.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/cli/commission/finding.hpp"

namespace server::cli {

struct RecordedSample {
  std::int64_t robot_time_us = 0;
  double position_m = 0;                  // the robot's own estimate
  std::optional<double> position_sd_m{};  // none: not known
  double acceleration_m_s2 = 0;
  double duty = 0;
  double impedance_mv = 0;
  long flags = 0;
};

// How the accelerometer answers one duty.
struct Response {
  double duty = 0;
  double velocity_m_s = 0, sd_m_s = 0;
  std::size_t rising = 0, falling = 0;  // edges
  std::size_t edges() const { return rising + falling; }
  bool is_seen() const;  // beyond the noise
};

inline constexpr double kResponseWindowS = 0.25;

// Of each duty that a push had, ascending. An edge whose window has a gap or another edge in it does not count.
std::vector<Response> responses_of(const std::vector<RecordedSample>& samples, double noise_m_s2);

enum class SeenByPerson : std::uint8_t { forwards, backwards, nothing };

struct DirectionFacts {
  Response response;  // to a duty above 0
  SeenByPerson person = SeenByPerson::nothing;
  bool is_noise_sound = true;  // imu_noise did not fail
};
StepFinding judge_motor_direction(const DirectionFacts& facts);
StepFinding judge_imu_axis(const DirectionFacts& facts);

// What became of a duty out of the motor's range. The station's own limits may let none through to the robot.
enum class DutyAnswer : std::uint8_t { none, refused_by_robot, refused_by_station, taken };

struct DeadZoneFacts {
  std::vector<Response> responses;
  std::size_t tried = 0;                    // duties
  bool is_one_way = false;                  // the controller in force runs the motor forwards alone
  DutyAnswer backwards = DutyAnswer::none;  // and what became of a duty below 0
  double parameter = 0;                     // dead_zone_duty of the robot
};
StepFinding judge_dead_zone(const DeadZoneFacts& facts);

// The largest duty at which the propeller stood still both ways, 0 if each moved the robot, and the smallest that moved
// it both ways; none: the parameter fits them, or they are not known.
struct DeadZoneToSet {
  double still = 0, moving = 0;
  double middle() const { return (still + moving) / 2; }
};
std::optional<DeadZoneToSet> dead_zone_to_set(const DeadZoneFacts& facts);

struct MotorFacts {
  nlohmann::json fit;   // the result of the job `identify` with second_order; null: it failed
  std::string failure;  // why
};
StepFinding judge_motor_constant(const MotorFacts& facts);
std::optional<double> gain_of(const MotorFacts& facts);  // m/s per duty

}  // namespace server::cli
