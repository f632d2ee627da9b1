// The reservations of robots that are not over: who is kept out of which robot, and when.
//
// A slot contains its first moment and not its last. Slots of one robot never overlap. Time is UTC, given by the
// caller: when the station's clock is set, slots begin and end by the new time. Loop thread; keeps no file: storage
// does.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/reservation.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

inline constexpr std::size_t kMostReservations = 200;                         // of a station, not over
inline constexpr microseconds kLongestReservation = std::chrono::days{7};     // from its beginning to its end
inline constexpr microseconds kFurthestReservation = std::chrono::days{366};  // from now to its end
inline constexpr microseconds kReservationNotice = std::chrono::minutes{10};  // to who is in control

// "2026-11-26 09:00:00 UTC".
std::string utc_text(std::int64_t utc_us);

class Reservations {
 public:
  // Finds the account of an actor. Without it, a user's page is the user's, everybody else is an account of their own.
  using AccountOf = std::function<std::string(const std::string& actor)>;
  void set_account_of(AccountOf account_of) { account_of_ = std::move(account_of); }
  std::string account_of(const std::string& actor) const;

  // Whether it may be made. invalid: its times; conflict: another one of the robot, which is named; unavailable: too
  // many are not over.
  Result<void> check(const Reservation& wanted, std::int64_t utc_us) const;
  void add(Reservation checked);
  void remove(ReservationId id);
  void forget_over(std::int64_t utc_us);

  const Reservation* find(ReservationId id) const;                              // null: over, or none
  const Reservation* running(const RobotId& robot, std::int64_t utc_us) const;  // of any holder; null: none
  // The first one that keeps the actor out at a moment of [from_us, until_us); null: none. SAFETY: the station itself
  // is never kept out, so that it can bring a robot to rest.
  const Reservation* keeps_out(const RobotId& robot, const std::string& actor, std::int64_t from_us,
                               std::int64_t until_us) const;
  const Reservation* keeps_out(const RobotId& robot, const std::string& actor, std::int64_t utc_us) const {
    return keeps_out(robot, actor, utc_us, utc_us + 1);
  }

 private:
  AccountOf account_of_;
  std::map<RobotId, std::vector<Reservation>> slots_;  // by their beginning
};

}  // namespace server::station
