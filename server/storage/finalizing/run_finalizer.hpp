// Makes runs final whose robot does not come back: what is missing of them is given up, and becomes gaps of that cause.
//
// That happens on the word of an admin, for a run; when a robot is revoked, for all that is missing of it; and, if the
// configuration says so, when a run has ended and its robot has not connected for a number of days. The recorder gives
// samples up in one commit together with the entry in the audit, then the digester makes the digest. A kill before that
// commit leaves everything as it was, and what a revoked robot or the time has left is looked for again.
//
// Loop thread. Needs run(); what it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/database/removal_clock.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/run_digester.hpp"

namespace server::storage {

class RunFinalizer {
 public:
  // `after_days`: 0 for never.
  RunFinalizer(runtime::Clock& clock, const RemovalClock& removal_clock, Recorder& recorder, DatabaseReader& reader,
               RunDigester& digester, std::uint32_t after_days);

  // Looks for what is to be given up every 30 s, until cancelled.
  boost::asio::awaitable<void> run();

  // Gives up what is missing of a run that has ended; `samples` is how many those are, as the caller saw it. Returns
  // the number. not_found, and conflict for a run that is open or discarded, and as Recorder::give_up().
  boost::asio::awaitable<Result<std::uint64_t>> finalize(RunId run, std::uint64_t samples, station::Author by);

  // The robot was revoked, and its connection is being ended: gives up all that is missing of it.
  boost::asio::awaitable<Result<std::uint64_t>> give_up_revoked(station::RobotId robot_id, station::Author by);

  std::uint32_t after_days() const { return after_days_; }

 private:
  boost::asio::awaitable<void> pass();
  boost::asio::awaitable<void> finalize_old_runs();
  boost::asio::awaitable<Result<std::uint64_t>> give_up(GiveUpOrder order);
  std::int64_t old_before_us() const;

  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
  RunDigester& digester_;
  const RemovalClock& removal_clock_;
  std::uint32_t after_days_;
  std::int64_t looked_at_us_ = 0;  // steady
  std::int64_t begun_us_ = 0;      // steady
};

}  // namespace server::storage
