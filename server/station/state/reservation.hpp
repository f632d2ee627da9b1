// A reservation of a robot: a time slot in which one account may command it, and nobody else.
//
// Plain values. An account is what may command in the slot: a user with all their pages and tokens ("user:anna"), a
// token of the station itself ("token:ci"), or the page of a one-time link ("session:3").
#pragma once

#include <cstdint>
#include <string>

namespace server::station {

using ReservationId = std::int64_t;

struct Reservation {
  ReservationId id = 0;
  std::string robot_id;
  std::string holder;         // an account
  std::int64_t from_us = 0;   // UTC, the first moment that belongs to it
  std::int64_t until_us = 0;  // UTC, the first moment that does not
  std::string purpose;        // for people; may be empty
  std::string made_by;        // an actor
  std::int64_t made_at_us = 0;
  std::int64_t cancelled_at_us = 0;  // 0: it is not
  std::string cancelled_by;
  bool operator==(const Reservation&) const = default;
};

}  // namespace server::station
