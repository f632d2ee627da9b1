// What the robot will do while it is commissioned: profiles of the station's experiments, each with small duties and an
// end, and the free length that they need.
//
//   pushes      each of five duties, the smallest first, twice forwards and, where the motor reverses, twice backwards
//   direction   one push forwards for a person to watch
//   steps       four steps of the largest duty, as of equation (27), there and back where the motor reverses
// The free length counts with kFastest, since nobody knows yet how fast the robot is, nor which way it goes.
// Errors: none.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace server::cli {

struct CommissionPlan {
  double largest_duty = 0.3;
  bool is_one_way = false;  // the motor runs forwards alone
};

// SAFETY: m/s per duty at rest; the fastest of the paper's models, (28), has 0.348.
inline constexpr double kFastestMS = 0.4;

inline constexpr double kRestS = 5;
inline constexpr int kStops = 10;

nlohmann::json rest_profile();
nlohmann::json pushes_profile(const CommissionPlan& plan);
nlohmann::json direction_profile(const CommissionPlan& plan);
nlohmann::json steps_profile(const CommissionPlan& plan);

double smallest_duty(const CommissionPlan& plan);
double direction_duty(const CommissionPlan& plan);

double duration_of(const nlohmann::json& profile);     // s
std::size_t duties_in(const nlohmann::json& profile);  // different ones, other than 0
// SAFETY: the farthest from where it begins that a robot of kFastestMS comes with all profiles of the motor in a row,
// either way, and if its reverse drives it forwards: the pushes, which show that, count one way.
double needed_m(const CommissionPlan& plan);

// Lines for the person, before anything happens.
std::vector<std::string> words_of(const CommissionPlan& plan);

}  // namespace server::cli
