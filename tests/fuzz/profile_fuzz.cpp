// Feeds any text to the reader of experiment profiles: what it does not take, it refuses as std::invalid_argument with
// a message, and the time line of what it takes is within the limits of the profile.
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "server/experiments/profile_document.hpp"
#include "server/experiments/time_line.hpp"
#include "tests/fuzz/targets.hpp"

namespace server::experiments {
namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void require_within(const Profile& all, const Variant& variant) {
  const Profile profile = profile_of_run(all, variant);
  const TimeLine line = time_line_of(all, variant);
  const ProfileLimits& limits = profile.limits;
  require(line.duration_s() <= limits.duration_max_s + kTick_s);
  require(line.step_begins.size() == profile.steps.size());
  std::uint64_t tick = 0;
  const Action* last_duty = nullptr;  // a robot takes no two duties for one tick
  for (const Action& action : line.actions) {
    if (action.kind == ActionKind::duty) require(last_duty == nullptr || action.tick > last_duty->tick);
    if (action.kind == ActionKind::duty) last_duty = &action;
    require(action.tick >= tick && action.tick <= line.ticks && std::isfinite(action.value));
    tick = action.tick;
    if (action.kind == ActionKind::duty) require(std::abs(action.value) <= limits.duty_max + 1e-9);
  }
  // SAFETY: the motor is off after the last duty.
  if (!is_closed_loop(profile.steps.back().kind)) require(line.actions.back().value == 0);
}

void read(std::string_view text) {
  Profile profile;
  try {
    profile = parse_profile(text, "fuzz.toml");
  } catch (const std::invalid_argument& error) {
    require(!std::string_view{error.what()}.empty());
    return;
  }
  const std::vector<Variant> variants = variants_of(profile);
  require(!variants.empty() && variants.size() <= kMostRuns);
  require_within(profile, variants.front());
  require_within(profile, variants.back());
}

}  // namespace
}  // namespace server::experiments

int fuzz::profile(const std::uint8_t* data, std::size_t size) {
  server::experiments::read({reinterpret_cast<const char*>(data), size});
  return 0;
}
