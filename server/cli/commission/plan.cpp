// Profiles as JSON documents, as `rheonaut profile --keys` lists their keys.
#include "server/cli/commission/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

namespace server::cli {
namespace {

using nlohmann::json;

constexpr std::array<double, 5> kShares{0.1, 0.2, 1.0 / 3, 2.0 / 3, 1};  // of the largest duty
constexpr double kPushS = 0.3, kDirectionS = 1, kStepS = 1;
constexpr int kPushes = 2;  // of each duty and direction
constexpr int kSteps = 2;   // there and back

json rest(double for_s) { return {{"kind", "rest"}, {"for_s", for_s}}; }
json push(double duty, double for_s) { return {{"kind", "duty"}, {"duty", duty}, {"for_s", for_s}}; }

double rounded(double duty) { return std::round(1000 * duty) / 1000; }

// SAFETY: the profile's own limit of the duty holds whatever its steps say, and each step ends by its time.
json profile_of(const char* name, const char* purpose, double largest_duty, json steps) {
  return {{"name", name},
          {"purpose", purpose},
          {"conditions", {{"start", "zero"}}},
          {"limits", {{"duty_max", std::max(0.001, largest_duty)}, {"duration_max_s", 60}}},
          {"step", std::move(steps)}};
}

// SAFETY: of all the time at a duty, as if every push went the same way while nobody knows that the reverse reverses.
double way_of(const json& profile, bool is_reverse_known) {
  double way_s = 0, farthest_s = 0;
  for (const json& step : profile.at("step")) {
    const double duty = step.value("duty", 0.0);
    way_s += (is_reverse_known ? duty : std::abs(duty)) * step.at("for_s").get<double>();
    farthest_s = std::max(farthest_s, std::abs(way_s));
  }
  return kFastestMS * farthest_s;
}

}  // namespace

double smallest_duty(const CommissionPlan& plan) { return rounded(kShares.front() * plan.largest_duty); }
double direction_duty(const CommissionPlan& plan) { return rounded(2.0 / 3 * plan.largest_duty); }

json rest_profile() {
  return profile_of("Commissioning: at rest", "Noise of the accelerometer and level of the electrode.", 0,
                    json::array({rest(kRestS)}));
}

json pushes_profile(const CommissionPlan& plan) {
  json steps = json::array({rest(0.5)});
  for (const double share : kShares) {
    for (int i = 0; i < kPushes; ++i) {
      for (const double direction : {1.0, -1.0}) {
        if (direction < 0 && plan.is_one_way) continue;
        steps.push_back(push(rounded(direction * share * plan.largest_duty), kPushS));
        steps.push_back(rest(kPushS));
      }
    }
  }
  return profile_of("Commissioning: pushes", "The smallest duty that moves the robot.", plan.largest_duty, steps);
}

json direction_profile(const CommissionPlan& plan) {
  return profile_of("Commissioning: direction", "Which way a duty above 0 drives the robot.", direction_duty(plan),
                    json::array({rest(0.5), push(direction_duty(plan), kDirectionS), rest(1)}));
}

json steps_profile(const CommissionPlan& plan) {
  json steps = json::array({rest(kStepS)});
  for (int i = 0; i < kSteps; ++i) {
    for (const double direction : {1.0, plan.is_one_way ? 1.0 : -1.0}) {
      steps.push_back(push(direction * plan.largest_duty, kStepS));
      steps.push_back(rest(kStepS));
    }
  }
  return profile_of("Commissioning: steps", "The motor constant, from steps of the duty.", plan.largest_duty, steps);
}

double duration_of(const json& profile) {
  double sum_s = 0;
  for (const json& step : profile.at("step")) sum_s += step.at("for_s").get<double>();
  return sum_s;
}

std::size_t duties_in(const json& profile) {
  std::set<double> duties;
  for (const json& step : profile.at("step")) duties.insert(step.value("duty", 0.0));
  duties.erase(0.0);
  return duties.size();
}

double needed_m(const CommissionPlan& plan) {
  // The steps come only after the pushes have shown the reverse.
  return way_of(pushes_profile(plan), false) + way_of(direction_profile(plan), false) +
         way_of(steps_profile(plan), !plan.is_one_way);
}

std::vector<std::string> words_of(const CommissionPlan& plan) {
  const char* ways = plan.is_one_way ? "forwards" : "both ways";
  return {
      fmt::format("1  {} emergency stops with the motor off, each confirmed by the robot and reset", kStops),
      fmt::format("2  at rest for {:.0f} s: accelerometer and electrode", kRestS),
      fmt::format("3  pushes of {:.1f} s {}, duty {:.2f} to {:.2f}: {:.0f} s{}", kPushS, ways, smallest_duty(plan),
                  plan.largest_duty, duration_of(pushes_profile(plan)),
                  plan.is_one_way ? fmt::format("; then a duty of {:.2f} for 1 ms, which the robot must refuse",
                                                -smallest_duty(plan))
                                  : ""),
      fmt::format("4  one push forwards, duty {:.2f} for {:.0f} s: you watch which way it goes", direction_duty(plan),
                  kDirectionS),
      fmt::format("5  four steps of duty {:.2f} for {:.0f} s, {}: the motor constant", plan.largest_duty, kStepS,
                  plan.is_one_way ? "forwards" : "there and back"),
      fmt::format(
          "The motor never gets more than duty {:.2f}, and each step ends by itself. The robot needs {:.2f} m of free "
          "way ahead and behind, if it is not faster than {:.1f} m/s per duty (the paper's fluids: 0.10 and 0.35).",
          plan.largest_duty, needed_m(plan), kFastestMS),
      "Ctrl-C ends it at any time, with an emergency stop of the robot. Keep its switch at hand all the same.",
  };
}

}  // namespace server::cli
