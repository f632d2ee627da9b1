// A lease a robot, ended by time, by its holder, by force or by a reservation.
#include "server/station/commands/authority.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace server::station {
namespace {

std::unexpected<Error> held_by(const RobotId& robot, const std::string& holder) {
  return fail(ErrorCode::conflict,
              fmt::format("robot '{}' is controlled by {}; ask for control, or wait until it ends", robot, holder),
              "not_in_control");
}

}  // namespace

ControlState Authority::of(const RobotId& robot) const {
  const auto found = leases_.find(robot);
  if (found == leases_.end() || !is_live(robot, found->second)) return {};
  const Lease& lease = found->second;
  const bool is_requested = lease.request_ends_us > clock_.steady_us();
  return {lease.holder, lease.taken_at_us, is_requested ? lease.requested_by.actor : std::string{}};
}

// SAFETY: a lease ends with the slot of somebody else, at once, and however often it is renewed.
bool Authority::is_live(const RobotId& robot, const Lease& lease) const {
  if (lease.ends_us <= clock_.steady_us()) return false;
  return lease.is_forced || reservations_.keeps_out(robot, lease.holder, clock_.utc_us()) == nullptr;
}

const Reservation* Authority::keeps_out(const RobotId& robot, const std::string& actor, microseconds ahead) const {
  const auto found = leases_.find(robot);
  const bool is_by_force = found != leases_.end() && found->second.is_forced && found->second.holder == actor &&
                           is_live(robot, found->second);
  if (is_by_force) return nullptr;
  const std::int64_t utc_us = clock_.utc_us();
  return reservations_.keeps_out(robot, actor, utc_us, utc_us + std::max<std::int64_t>(ahead.count(), 1));
}

Result<void> Authority::check_reserved(const RobotId& robot, const std::string& actor) const {
  const Reservation* reservation = keeps_out(robot, actor, microseconds{0});
  if (reservation == nullptr) return {};
  return fail(ErrorCode::conflict,
              fmt::format("robot '{}' is reserved for {} until {} (reservation {}) and {} may not command it; wait "
                          "until then, or ask {} or an administrator to cancel it",
                          robot, reservation->holder, utc_text(reservation->until_us), reservation->id, actor,
                          reservation->holder),
              "reserved");
}

Authority::Lease* Authority::lease_of(const RobotId& robot) {
  const auto found = leases_.find(robot);
  return found == leases_.end() || !is_live(robot, found->second) ? nullptr : &found->second;
}

Authority::Lease& Authority::give(const RobotId& robot, const Client& client, microseconds duration) {
  Lease& lease = leases_[robot];
  lease = Lease{client.actor, client.id, clock_.utc_us(), clock_.steady_us() + duration.count(), duration, {}, 0};
  return lease;
}

Result<Authority::Lease*> Authority::own_lease(const RobotId& robot, const std::string& actor) {
  Lease* lease = lease_of(robot);
  if (lease == nullptr) {
    return fail(ErrorCode::conflict, fmt::format("nobody controls robot '{}'", robot), "not_in_control");
  }
  if (lease->holder != actor) return held_by(robot, lease->holder);
  return lease;
}

Result<void> Authority::may_use(const RobotId& robot, const std::string& actor) const {
  if (auto checked = check_reserved(robot, actor); !checked) return checked;
  const ControlState now = of(robot);
  if (now.holder.empty() || now.holder == actor) return {};
  return held_by(robot, now.holder);
}

Result<std::optional<Authority::Change>> Authority::use(const RobotId& robot, const Client& client, bool steers) {
  Lease* lease = lease_of(robot);
  if (lease == nullptr || lease->holder != client.actor) return take(robot, client, kControlLease);
  if (lease->client != client.id) {  // what another client of the actor asks of the robot beside it, changes no hands
    if (steers) give(robot, client, kControlLease);
    return std::nullopt;
  }
  lease->ends_us = std::max(lease->ends_us, clock_.steady_us() + kControlLease.count());
  return std::nullopt;
}

Result<std::optional<Authority::Change>> Authority::take(const RobotId& robot, const Client& client,
                                                         microseconds duration) {
  // SAFETY: nobody commands in the slot of somebody else.
  if (auto checked = check_reserved(robot, client.actor); !checked) return std::unexpected{checked.error()};
  Lease* lease = lease_of(robot);
  // SAFETY: control is never shared, and never changes hands behind its holder's back.
  if (lease != nullptr && lease->holder != client.actor) return held_by(robot, lease->holder);
  if (lease != nullptr) {
    const bool is_other = std::exchange(lease->client, client.id) != client.id;
    lease->duration = duration;
    lease->ends_us = clock_.steady_us() + duration.count();
    if (is_other) return Change{robot, "control_taken", "by " + text(client)};
    return std::nullopt;
  }
  give(robot, client, duration);
  return Change{robot, "control_taken", "by " + text(client)};
}

Authority::Change Authority::take_by_force(const RobotId& robot, const Client& client, const std::string& reason) {
  const Lease* lease = lease_of(robot);
  const std::string from = lease == nullptr ? "nobody" : lease->holder;
  give(robot, client, kControlLease).is_forced = true;
  return {robot, "control_forced", fmt::format("by {} from {}: {}", text(client), from, reason)};
}

Result<Authority::Change> Authority::release(const RobotId& robot, const std::string& actor) {
  const auto lease = own_lease(robot, actor);
  if (!lease) return std::unexpected{lease.error()};
  leases_.erase(robot);
  return Change{robot, "control_released", "by " + actor};
}

Result<Authority::Change> Authority::request(const RobotId& robot, const Client& client) {
  if (auto checked = check_reserved(robot, client.actor); !checked) return std::unexpected{checked.error()};
  Lease* lease = lease_of(robot);
  if (lease == nullptr) {
    return fail(ErrorCode::conflict, fmt::format("nobody controls robot '{}'; take control", robot), "control_is_free");
  }
  if (lease->holder == client.actor) return fail(ErrorCode::conflict, "you are in control already", "in_control");
  lease->requested_by = client;
  lease->request_ends_us = clock_.steady_us() + kRequestTimeout.count();
  return Change{robot, "control_requested", fmt::format("by {} from {}", client.actor, lease->holder)};
}

Result<Authority::Change> Authority::hand_over(const RobotId& robot, const std::string& actor) {
  const auto lease = own_lease(robot, actor);
  if (!lease) return std::unexpected{lease.error()};
  if ((*lease)->request_ends_us <= clock_.steady_us()) {
    return fail(ErrorCode::conflict, fmt::format("nobody has asked for control of robot '{}'", robot), "not_requested");
  }
  const Client to = (*lease)->requested_by;
  // SAFETY: a slot that keeps them out may have begun since they asked.
  if (auto checked = check_reserved(robot, to.actor); !checked) return std::unexpected{checked.error()};
  give(robot, to, kControlLease);
  return Change{robot, "control_handed_over", fmt::format("by {} to {}", actor, text(to))};
}

Client Authority::client_of(const RobotId& robot) const {
  const auto found = leases_.find(robot);
  if (found == leases_.end() || !is_live(robot, found->second)) return {};
  return {found->second.holder, found->second.client};
}

bool Authority::is_kept_by(const RobotId& robot, const Client& client) const {
  const Client now = client_of(robot);
  return now.actor.empty() || now == client;
}

// SAFETY: what has ended stays ended; and another client of the same actor, in whatever tab or program, keeps nothing.
void Authority::extend(const RobotId& robot, Lease& lease, const Client& client) const {
  if (Client{lease.holder, lease.client} != client || !is_live(robot, lease)) return;
  lease.ends_us = std::max(lease.ends_us, clock_.steady_us() + lease.duration.count());
}

void Authority::keep_alive(const RobotId& robot, const Client& client) {
  if (const auto found = leases_.find(robot); found != leases_.end()) extend(robot, found->second, client);
}

void Authority::keep_all_alive(const Client& client) {
  for (auto& [robot, lease] : leases_) extend(robot, lease, client);
}

std::optional<Authority::Change> Authority::end_right(const RobotId& robot, const runtime::EndedRight& right) {
  Lease* lease = lease_of(robot);
  if (lease == nullptr) return std::nullopt;
  if (right.is_of(lease->requested_by.actor)) {
    lease->requested_by = {};
    lease->request_ends_us = 0;
  }
  if (!right.is_of(lease->holder)) return std::nullopt;
  Change change{robot, "control_ended_with_right", fmt::format("of {}: {}", lease->holder, right.why)};
  leases_.erase(robot);
  return change;
}

std::vector<Authority::Change> Authority::expire() {
  std::vector<Change> changes;
  std::erase_if(leases_, [&](const auto& entry) {
    const auto& [robot, lease] = entry;
    if (is_live(robot, lease)) return false;
    const Reservation* by = reservations_.keeps_out(robot, lease.holder, clock_.utc_us());
    if (lease.ends_us <= clock_.steady_us() || by == nullptr) {
      changes.push_back({robot, "control_expired", lease.holder + " has gone silent"});
    } else {
      changes.push_back({robot, "control_ended_by_reservation",
                         fmt::format("of {}: the robot is reserved for {}", lease.holder, by->holder)});
    }
    return true;
  });
  return changes;
}

}  // namespace server::station
