// The reservations in the database: one row each, kept when it is over or cancelled.
//
// Only stores: the station checks them before, and keeps them in force afterwards. Of those that are over or cancelled
// the newest kMaxKeptReservations are kept. Loop thread; SQL on the disk thread and the readers'. Clock, recorder and
// reader outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/station/state/reservation.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::storage {

inline constexpr std::int64_t kMaxKeptReservations = 10'000;

struct ReservationFilter {
  std::optional<std::string> robot_id;
  std::optional<bool> is_over;  // or cancelled
  std::int64_t before = 0;      // only lower numbers; 0: all
  std::size_t limit = 100;
};

class ReservationBook {
 public:
  ReservationBook(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader)
      : clock_{clock}, recorder_{recorder}, reader_{reader} {}

  // Those that are neither over nor cancelled. Throws when they cannot be read.
  boost::asio::awaitable<std::vector<station::Reservation>> load();

  // On disk, with its entry in the audit, when it answers; id, made_by and made_at_us are set. conflict: another one of
  // the robot was stored meanwhile; unavailable when the disk cannot be written.
  boost::asio::awaitable<Result<station::Reservation>> store(station::Reservation checked, station::Author by);
  // Likewise. conflict: it is cancelled already, or over; not_found.
  boost::asio::awaitable<Result<station::Reservation>> cancel(station::ReservationId id, station::Author by);

  boost::asio::awaitable<std::optional<station::Reservation>> find(station::ReservationId id);
  boost::asio::awaitable<std::vector<station::Reservation>> list(ReservationFilter filter);  // the newest first

 private:
  template <class Job>
  boost::asio::awaitable<Result<station::Reservation>> change(Job job);

  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
};

}  // namespace server::storage
