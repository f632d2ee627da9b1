// Makes one record of the renewals of a lease that follow each other: the first of them, with how many followed it.
//
// A duty that is held is renewed some seven times a second; a row and an entry of the audit for each would fill the
// disk.
//
//   the first is accepted → its record is due, with further_renewals not known … → and again, with their number
//
// A renewal belongs to those before it while the same actor renews from the same address, with the same arguments, in
// the same boot of the robot; while nobody gives the robot another command; and while no more than kSilence passes from
// one answer to the next. One that the robot does not accept is a record of its own, as any other command is.
// Of one that follows, nothing is recorded before it has ended.
//
// Plain bookkeeping. Loop thread. Times are the caller's, steady.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/station/state/station_state.hpp"

namespace server::storage {

class Renewals {
 public:
  using Records = std::vector<station::CommandRecord>;

  static constexpr microseconds kSilence{1'000'000};  // a lease lasts half of it

  // A command has come into this state. What is to be written now, in this order.
  Records take(const station::CommandRecord& command, std::int64_t now_us);
  // Those that no renewal has followed for kSilence.
  Records take_ended(std::int64_t now_us);
  // The program ends: all, and what is on its way as it is.
  Records take_all();

  bool empty() const { return by_robot_.empty(); }

 private:
  struct Row {
    station::CommandRecord first;
    bool is_accepted = false;                                           // the first; it is written
    bool is_over = false;                                               // nothing more belongs to it
    std::map<station::CommandId, station::CommandRecord> on_their_way;  // those that follow
    std::int64_t answered_us = 0;                                       // the latest
    std::uint64_t further = 0;                                          // accepted after the first
    std::int64_t last_renewed_at_us = 0;                                // UTC

    bool is_waiting() const { return !is_accepted || !on_their_way.empty(); }
    station::CommandRecord record() const;
  };
  using Rows = std::vector<Row>;

  static void take_renewal(Rows& rows, const station::CommandRecord& renewal, std::int64_t now_us, Records& due);
  static void take_first(Rows& rows, Rows::iterator row, const station::CommandRecord& renewal, std::int64_t now_us,
                         Records& due);
  static void take_next(Row& row, const station::CommandRecord& renewal, std::int64_t now_us, Records& due);
  static void take_over(Rows& rows, Records& due);

  std::map<station::RobotId, Rows> by_robot_;  // without those that have none; of a robot one that goes on, at most
};

}  // namespace server::storage
