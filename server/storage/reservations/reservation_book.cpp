// A few statements for each call, in one transaction.
#include "server/storage/reservations/reservation_book.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "server/runtime/exceptions.hpp"
#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace asio = boost::asio;
using station::Reservation;
using station::ReservationId;

namespace {

constexpr const char* kColumns =
    "reservation_id, robot_id, holder, from_us, until_us, purpose, made_by, made_at_us, coalesce(cancelled_at_us, 0),"
    " cancelled_by";

Reservation reservation_of(SQLite::Statement& row) {
  return {row.getColumn(0).getInt64(),  row.getColumn(1).getString(), row.getColumn(2).getString(),
          row.getColumn(3).getInt64(),  row.getColumn(4).getInt64(),  row.getColumn(5).getString(),
          row.getColumn(6).getString(), row.getColumn(7).getInt64(),  row.getColumn(8).getInt64(),
          row.getColumn(9).getString()};
}

std::vector<Reservation> read_list(SQLite::Database& database, const ReservationFilter& filter, std::int64_t utc_us) {
  SQLite::Statement rows{database,
                         fmt::format("SELECT {} FROM reservation WHERE (?1 IS NULL OR robot_id = ?1)"
                                     " AND (?2 IS NULL OR (cancelled_at_us IS NOT NULL OR until_us <= ?3) = ?2)"
                                     " AND (?4 = 0 OR reservation_id < ?4) ORDER BY reservation_id DESC LIMIT ?5",
                                     kColumns)};
  const auto is_over = filter.is_over ? std::optional{std::int64_t{*filter.is_over}} : std::nullopt;
  bind_all(rows, filter.robot_id, is_over, utc_us, filter.before, static_cast<std::int64_t>(filter.limit));
  std::vector<Reservation> found;
  while (rows.executeStep()) found.push_back(reservation_of(rows));
  return found;
}

std::optional<Reservation> read_one(SQLite::Database& database, ReservationId id) {
  SQLite::Statement row{database, fmt::format("SELECT {} FROM reservation WHERE reservation_id = ?", kColumns)};
  bind_all(row, id);
  return row.executeStep() ? std::optional{reservation_of(row)} : std::nullopt;
}

void forget_old(SQLite::Database& database, std::int64_t utc_us) {
  SQLite::Statement forget{database,
                           "DELETE FROM reservation WHERE reservation_id IN (SELECT reservation_id FROM reservation"
                           " WHERE cancelled_at_us IS NOT NULL OR until_us <= ?"
                           " ORDER BY reservation_id DESC LIMIT -1 OFFSET ?)"};
  execute(forget, utc_us, kMaxKeptReservations);
}

void note(SQLite::Database& database, const char* action, const Reservation& reservation, const station::Author& by) {
  station::AuditNote entry;
  entry.by = by;
  entry.robot_id = reservation.robot_id;
  entry.action = action;
  entry.subject = fmt::format("{}", reservation.id);
  entry.detail = station::audit_detail({{"holder", reservation.holder},
                                        {"from_us", reservation.from_us},
                                        {"until_us", reservation.until_us},
                                        {"purpose", reservation.purpose}});
  AuditChain{database}.append(entry);
}

Result<Reservation> add(SQLite::Database& database, Reservation made, const station::Author& by) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement insert{database,
                           "INSERT INTO reservation (robot_id, holder, from_us, until_us, purpose, made_by, made_at_us)"
                           " VALUES (?, ?, ?, ?, ?, ?, ?) RETURNING reservation_id"};
  made.made_by = by.actor;
  made.made_at_us = by.at_us;
  bind_all(insert, made.robot_id, made.holder, made.from_us, made.until_us, made.purpose, made.made_by,
           made.made_at_us);
  insert.executeStep();
  made.id = insert.getColumn(0).getInt64();
  insert.reset();
  forget_old(database, by.at_us);
  note(database, "reservation.made", made, by);
  transaction.commit();
  return made;
}

Result<Reservation> end(SQLite::Database& database, ReservationId id, const station::Author& by) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement update{database,
                           "UPDATE reservation SET cancelled_at_us = ?, cancelled_by = ? WHERE reservation_id = ?"
                           " AND cancelled_at_us IS NULL AND until_us > ?"};
  const int changed = execute(update, by.at_us, by.actor, id, by.at_us);
  const auto now = read_one(database, id);
  if (!now) return fail(ErrorCode::not_found, fmt::format("there is no reservation {}", id), "no_such_reservation");
  if (changed == 0) {
    const char* why = now->cancelled_at_us != 0 ? "cancelled already" : "over";
    return fail(ErrorCode::conflict, fmt::format("reservation {} is {}", id, why), "wrong_state");
  }
  note(database, "reservation.cancelled", *now, by);
  transaction.commit();
  return *now;
}

}  // namespace

template <class Job>
asio::awaitable<Result<Reservation>> ReservationBook::change(Job job) {
  auto guarded = [job = std::move(job)](Database& database) -> Result<Reservation> {
    try {
      return job(database.handle());
    } catch (const SQLite::Exception& error) {
      if (error.getExtendedErrorCode() == SQLITE_CONSTRAINT_TRIGGER) {
        return fail(ErrorCode::conflict, "another reservation of this robot was made meanwhile", "reserved");
      }
      return fail(ErrorCode::unavailable, fmt::format("it could not be stored: {}; try again", runtime::text_of(error)),
                  "not_stored");
    }
  };
  co_return co_await recorder_.on_disk(std::move(guarded));
}

asio::awaitable<std::vector<Reservation>> ReservationBook::load() {
  // And those that are over for less than a day: the clock may be ahead.
  const std::int64_t utc_us = clock_.utc_us() - std::chrono::microseconds{std::chrono::days{1}}.count();
  auto job = [utc_us](Database& database) {
    ReservationFilter not_over;
    not_over.is_over = false;
    not_over.limit = kMaxKeptReservations;
    return read_list(database.handle(), not_over, utc_us);
  };
  co_return co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<Result<Reservation>> ReservationBook::store(Reservation checked, station::Author by) {
  by.at_us = clock_.utc_us();
  auto job = [checked, by](SQLite::Database& database) { return add(database, checked, by); };
  co_return co_await change(std::move(job));
}

asio::awaitable<Result<Reservation>> ReservationBook::cancel(ReservationId id, station::Author by) {
  by.at_us = clock_.utc_us();
  auto job = [id, by](SQLite::Database& database) { return end(database, id, by); };
  co_return co_await change(std::move(job));
}

asio::awaitable<std::optional<Reservation>> ReservationBook::find(ReservationId id) {
  auto query = [id](SQLite::Database& database) { return read_one(database, id); };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<std::vector<Reservation>> ReservationBook::list(ReservationFilter filter) {
  auto query = [filter, utc_us = clock_.utc_us()](SQLite::Database& database) {
    return read_list(database, filter, utc_us);
  };
  co_return co_await reader_.ask(std::move(query));
}

}  // namespace server::storage
