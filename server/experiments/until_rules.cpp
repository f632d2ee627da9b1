#include "server/experiments/until_rules.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/invalid_argument.hpp"
#include "control/search/fit.hpp"
#include "server/experiments/duty_signals.hpp"
#include "server/experiments/time_line.hpp"

namespace server::experiments {
namespace {

constexpr std::size_t kMostChoices = 50;    // of a profile with until
constexpr std::uint64_t kFewestTicks = 20;  // that a fit takes
constexpr double kAroundARun_s = 5;         // recorded before and after the step

}  // namespace

Until until_from(const std::string& given) {
  for (std::size_t i = 0; i < control::kParameterNames.size(); ++i) {
    const std::string before = base::join_text("sigma(", control::kParameterNames[i], ") <= ");
    if (!given.starts_with(before)) continue;
    Until until{i, 0};
    const char* end = given.data() + given.size();
    const auto [read, error] = std::from_chars(given.data() + before.size(), end, until.sigma);
    if (error == std::errc{} && read == end && until.sigma > 0 && std::isfinite(until.sigma)) return until;
  }
  base::throw_invalid("until is '", given,
                      "', it must be like sigma(alpha) <= 0.02, of kp, b1, b2, alpha or beta, and ", "above 0");
}

void check_until(const Profile& profile) {
  if (!profile.until) return;
  const Sweep& sweep = profile.sweep;
  if (profile.conditions.start == StartPosition::here) {
    base::throw_invalid(
        "conditions.start is here, a profile with until counts each run from its beginning: zero or back");
  }
  if (std::ranges::find(sweep.duty_factor, 0) != sweep.duty_factor.end()) {
    base::throw_invalid("sweep.duty_factor has 0, which moves nothing; a profile with until allows none");
  }
  if (sweep.repeats > 1 || !sweep.setpoint_factor.empty() || !sweep.fluids.empty() || !sweep.controllers.empty()) {
    base::throw_invalid("a sweep has a profile with until = \"", text(*profile.until),
                        "\": there it has duty_factor only");
  }
}

// What one fit takes, and what is computed between two runs.
void check_amount(const Profile& profile) {
  if (!profile.until) return;
  const std::size_t choices = profile.steps.size() * std::max<std::size_t>(profile.sweep.duty_factor.size(), 1);
  if (choices > kMostChoices) {
    base::throw_invalid("the steps and their duty factors are ", choices, " choices, allowed are ", kMostChoices);
  }
  const double samples =
      static_cast<double>(profile.most_runs) * (longest_duration_s(profile) + kAroundARun_s) / kTick_s;
  if (samples > static_cast<double>(control::kMostSamples)) {
    base::throw_invalid("most_runs = ", profile.most_runs, " of its longest step are ", samples,
                        " samples, one fit takes ", control::kMostSamples);
  }
}

void check_choice(const Step& step) {
  const bool moves_by_duty = !is_closed_loop(step.kind) && step.kind != StepKind::rest;
  if (!moves_by_duty) {
    base::throw_invalid("kind is ", step_kinds()[static_cast<std::size_t>(step.kind)], ", a profile with until has ",
                        "only steps that excite the robot by a duty: duty, staircase, ramp, chirp, prbs, multisine");
  }
  const auto changes = duty_changes(step);
  const bool moves = std::ranges::any_of(changes, [](const DutyChange& change) { return change.duty != 0; });
  if (!moves || ticks_of(step) < kFewestTicks) {
    base::throw_invalid("a step of a profile with until moves the robot, and takes at least ", kFewestTicks * kTick_s,
                        " s; for_s is ", step.for_s);
  }
}

}  // namespace server::experiments
