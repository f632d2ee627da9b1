// Markers: notes of people at a sample of a robot's recording. They belong to the recording, so a run shows those
// in its spans, and one made afterwards has them, too.
//
// Loop thread; SQL on the disk thread and the readers'.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

struct Marker {
  std::int64_t id = 0;
  station::BootId boot_id = 0;
  std::uint64_t seq = 0;
  std::optional<std::uint64_t> robot_time_us;  // both of the sample; empty while nothing of its boot is stored
  std::optional<std::int64_t> utc_us;
  std::string text;
  std::string actor;
  std::int64_t made_at_us = 0;  // UTC
};

struct MarkerRequest {
  station::RobotId robot_id;
  std::string text;  // 1 to 4000 bytes
  std::string actor;
  std::optional<std::int64_t> at_us;  // UTC: the sample then, or the last one before
  station::BootId boot_id = 0;  // of the robot's present connection, 0 when there is none: its newest sample is now
};

// The place of a marker in a run.
struct MarkerCursor {
  std::uint32_t span = 0;
  std::uint64_t seq = 0;
  std::int64_t id = 0;
};

struct MarkerPage {
  std::vector<Marker> markers;
  std::optional<MarkerCursor> next;  // of the last one of the page; empty: the end
};

class Markers {
 public:
  Markers(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader)
      : clock_{clock}, recorder_{recorder}, reader_{reader} {}

  // A marker now is at the robot's newest sample, or where a run of it begins with the next one, at that one: what is
  // marked in a run belongs to it. not_connected for a marker now of a robot that is not there; invalid for a time that
  // is in the future or has no sample, or for a bad text.
  boost::asio::awaitable<Result<Marker>> add(MarkerRequest request);

  // In the order in which they were made, at most `limit` after the marker `after` (0: from the first).
  boost::asio::awaitable<std::vector<Marker>> of_robot(station::RobotId robot_id, std::int64_t after,
                                                       std::size_t limit);
  // In order of span and seq, at most `limit` after the cursor.
  boost::asio::awaitable<Result<MarkerPage>> of_run(RunId run, std::optional<MarkerCursor> after, std::size_t limit);

 private:
  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
};

}  // namespace server::storage
