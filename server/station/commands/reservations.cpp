// Few slots a robot: each question looks at all of them.
#include "server/station/commands/reservations.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace server::station {
namespace {

bool overlaps(const Reservation& slot, std::int64_t from_us, std::int64_t until_us) {
  return slot.from_us < until_us && from_us < slot.until_us;
}

std::unexpected<Error> wrong_time(std::string detail) {
  return fail(ErrorCode::invalid, std::move(detail), "out_of_range");
}

Result<void> check_times(const Reservation& wanted, std::int64_t utc_us) {
  // First of all: they may be any number, and below they are written and subtracted.
  const std::int64_t earliest_us = utc_us - kLongestReservation.count();
  const std::int64_t latest_us = utc_us + kFurthestReservation.count();
  for (const std::int64_t time_us : {wanted.from_us, wanted.until_us}) {
    if (time_us >= earliest_us && time_us <= latest_us) continue;
    return wrong_time(fmt::format("a reservation is between {} and {}", utc_text(earliest_us), utc_text(latest_us)));
  }
  if (wanted.from_us >= wanted.until_us) {
    return wrong_time(fmt::format("a reservation from {} until {} ends before it begins", utc_text(wanted.from_us),
                                  utc_text(wanted.until_us)));
  }
  if (wanted.until_us <= utc_us) {
    return wrong_time(fmt::format("a reservation until {} is over already", utc_text(wanted.until_us)));
  }
  if (wanted.until_us - wanted.from_us <= kLongestReservation.count()) return {};
  return wrong_time(fmt::format("a reservation lasts at most {} days", kLongestReservation / std::chrono::days{1}));
}

}  // namespace

std::string utc_text(std::int64_t utc_us) {
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(static_cast<std::time_t>(utc_us / 1'000'000)));
}

std::string Reservations::account_of(const std::string& actor) const {
  if (actor.starts_with("user:")) return actor.substr(0, actor.find('/'));
  return account_of_ ? account_of_(actor) : actor;
}

Result<void> Reservations::check(const Reservation& wanted, std::int64_t utc_us) const {
  if (auto checked = check_times(wanted, utc_us); !checked) return checked;
  std::size_t count = 0;
  for (const auto& [robot, slots] : slots_) {
    for (const Reservation& slot : slots) {
      count += slot.until_us > utc_us ? 1U : 0U;
      if (robot != wanted.robot_id || !overlaps(slot, wanted.from_us, wanted.until_us)) continue;
      return fail(ErrorCode::conflict,
                  fmt::format("robot '{}' is reserved for {} from {} until {} (reservation {})", robot, slot.holder,
                              utc_text(slot.from_us), utc_text(slot.until_us), slot.id),
                  "reserved");
    }
  }
  if (count < kMostReservations) return {};
  return fail(ErrorCode::unavailable,
              fmt::format("{} reservations are not over, and there cannot be more; cancel one", kMostReservations),
              "too_many_reservations");
}

void Reservations::add(Reservation checked) {
  std::vector<Reservation>& slots = slots_[checked.robot_id];
  slots.push_back(std::move(checked));
  std::ranges::sort(slots, {}, &Reservation::from_us);
}

void Reservations::remove(ReservationId id) {
  for (auto& [robot, slots] : slots_) {
    std::erase_if(slots, [id](const Reservation& slot) { return slot.id == id; });
  }
}

void Reservations::forget_over(std::int64_t utc_us) {
  for (auto& [robot, slots] : slots_) {
    std::erase_if(slots, [utc_us](const Reservation& slot) { return slot.until_us <= utc_us; });
  }
  std::erase_if(slots_, [](const auto& entry) { return entry.second.empty(); });
}

const Reservation* Reservations::find(ReservationId id) const {
  for (const auto& [robot, slots] : slots_) {
    const auto found = std::ranges::find(slots, id, &Reservation::id);
    if (found != slots.end()) return &*found;
  }
  return nullptr;
}

const Reservation* Reservations::running(const RobotId& robot, std::int64_t utc_us) const {
  const auto found = slots_.find(robot);
  if (found == slots_.end()) return nullptr;
  const auto slot = std::ranges::find_if(
      found->second, [utc_us](const Reservation& one) { return overlaps(one, utc_us, utc_us + 1); });
  return slot == found->second.end() ? nullptr : &*slot;
}

const Reservation* Reservations::keeps_out(const RobotId& robot, const std::string& actor, std::int64_t from_us,
                                           std::int64_t until_us) const {
  const auto found = slots_.find(robot);
  const bool is_station = actor.starts_with("station:");
  if (found == slots_.end() || is_station) return nullptr;
  const std::string account = account_of(actor);
  const auto slot = std::ranges::find_if(
      found->second, [&](const Reservation& one) { return one.holder != account && overlaps(one, from_us, until_us); });
  return slot == found->second.end() ? nullptr : &*slot;
}

}  // namespace server::station
