// Limits, margins, and what to do.
#include "server/cli/commission/travel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace server::cli {

namespace {

nlohmann::ordered_json number_or_null(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

std::string position_text(double position_m, const std::optional<double>& sd_m) {
  if (!sd_m) return fmt::format("{:+.0f} mm, ± not known", 1e3 * position_m);
  return fmt::format("{:+.0f} ± {:.0f} mm (2 sd)", 1e3 * position_m, 2e3 * *sd_m);
}

}  // namespace

std::optional<double> sum_of(const std::optional<double>& one_m, const std::optional<double>& other_m) {
  return one_m && other_m ? std::optional{*one_m + *other_m} : std::nullopt;
}

StepFinding judge_free_travel(const TravelFacts& facts) {
  const double stop_m = facts.gain_m_s.value_or(0) * facts.duty_max * facts.worst_stop_ms / 1e3;
  const std::optional<double> position_sd_m = sum_of(facts.believed_sd_m, facts.zero_sd_m);
  const double unsure_m = 2 * position_sd_m.value_or(0);
  StepFinding finding{
      .step = "free_travel",
      .verdict = Verdict::pass,
      .found = fmt::format("free {:.3f} m ahead and {:.3f} m behind by ruler; the robot's limits {:+.2f} and {:+.2f} m",
                           facts.ahead_m, facts.behind_m, facts.limit_max_m, facts.limit_min_m),
      .bound =
          "the robot's own limits, from where its zero lies now, lie within the free length: by the way that it "
          "swims until a stop arrives, and by 2 sd of its position",
      .action = "put it back to the start and zero its position: its limits count from its zero"};
  finding.figures = {{"ahead_m", facts.ahead_m},
                     {"behind_m", facts.behind_m},
                     {"position_limit_min_m", facts.limit_min_m},
                     {"position_limit_max_m", facts.limit_max_m},
                     {"believed_m", facts.believed_m},
                     {"believed_sd_m", number_or_null(facts.believed_sd_m)},
                     {"zero_m", facts.zero_m},
                     {"zero_sd_m", number_or_null(facts.zero_sd_m)},
                     {"measured_m", number_or_null(facts.measured_m)},
                     {"stop_way_m", facts.gain_m_s ? nlohmann::ordered_json(stop_m) : nullptr}};
  if (facts.gain_m_s) {
    finding.found += fmt::format("; at full duty it swims {:.0f} mm until the slowest stop arrives", 1e3 * stop_m);
  }
  finding.found += "; after the push it believed " + position_text(facts.believed_m, facts.believed_sd_m);
  const double wrong_m = facts.measured_m ? *facts.measured_m - facts.believed_m : 0;
  if (facts.measured_m) finding.found += fmt::format(", by ruler it moved {:+.0f} mm", 1e3 * *facts.measured_m);
  finding.found +=
      fmt::format("; its zero lies at {} of the start by now", position_text(facts.zero_m, facts.zero_sd_m));
  const double margin_m = stop_m + unsure_m;
  const bool is_within = facts.zero_m + facts.limit_max_m + margin_m <= facts.ahead_m &&
                         facts.zero_m + facts.limit_min_m - margin_m >= -facts.behind_m;
  constexpr double kRulerM = 0.002;  // what a ruler may be wrong by
  if (!is_within) {
    constexpr double kWellWithin = 0.8;  // of the free way
    const auto rounded_m = [margin_m](double free_m) {
      return std::max(0.01, std::floor(100 * (kWellWithin * free_m - margin_m)) / 100);
    };
    finding.verdict = Verdict::attention;
    finding.action = fmt::format(
        "put it back to the start, zero its position, and set position_limit_max_m={:.2f} and "
        "position_limit_min_m={:.2f} (rheonaut robot parameters, with --confirm)",
        rounded_m(facts.ahead_m), -rounded_m(facts.behind_m));
  } else if (!position_sd_m) {
    finding.verdict = Verdict::attention;
    finding.action =
        "the robot does not say how certain its position is (position_sd_m), so its limits may hold by less than they "
        "seem to: see to its firmware, put it back to the start and zero its position";
  } else if (std::abs(wrong_m) > 2 * *facts.believed_sd_m + kRulerM) {
    finding.verdict = Verdict::attention;
    finding.action =
        "the robot believes a wrong way: give it a model of this fluid before anything relies on its position "
        "(docs/first_robot.md, steps 5 and 6)";
  }
  return finding;
}

}  // namespace server::cli
