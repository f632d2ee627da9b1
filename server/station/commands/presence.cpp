#include "server/station/commands/presence.hpp"

#include <algorithm>

#include "server/station/commands/requests.hpp"

namespace server::station {
namespace {

constexpr std::int64_t kForgetEveryUs = 60'000'000;

}  // namespace

void Presence::note(const std::string& actor, microseconds age) {
  if (!is_fresh(age)) return;
  forget_old();
  std::int64_t& seen_us = seen_us_[actor];
  seen_us = std::max(seen_us, clock_.steady_us() - age.count());
}

std::optional<std::int64_t> Presence::seen_us(const std::string& actor) const {
  const auto found = seen_us_.find(actor);
  if (found == seen_us_.end() || found->second < clock_.steady_us() - kForgottenAfter.count()) return std::nullopt;
  return found->second;
}

void Presence::forget_old() {
  const std::int64_t now_us = clock_.steady_us();
  if (now_us - forgotten_at_us_ < kForgetEveryUs) return;
  forgotten_at_us_ = now_us;
  std::erase_if(seen_us_, [now_us](const auto& one) { return one.second < now_us - kForgottenAfter.count(); });
}

}  // namespace server::station
