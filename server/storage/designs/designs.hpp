// The designs in the database: rows that are added, and never changed or removed.
//
// Loop thread; SQL on the disk thread and the readers'. Clock, recorder and reader outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/designs/design.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::storage {

inline constexpr std::size_t kMostAncestors = 100;  // that are shown
inline constexpr std::size_t kMostRunsMadeWith = 1000;
inline constexpr std::size_t kMostControllersOfRun = 100;  // equal ones, each kept by itself

class Designs {
 public:
  Designs(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader)
      : clock_{clock}, recorder_{recorder}, reader_{reader} {}

  // On disk, with its entry in the audit, when it answers. The document is a checked one. invalid: a parent or a model
  // that is not there or of the wrong kind, or a run that is not there; unavailable when the disk cannot be written.
  boost::asio::awaitable<Result<Design>> store(DesignRequest request, station::Author by);

  boost::asio::awaitable<Result<Design>> find(DesignId id);
  boost::asio::awaitable<std::vector<Design>> list(DesignFilter filter);

  // A controller of a design is about to be sent to a robot. On disk when it answers: a run that begins with this
  // checksum on this robot is made with the design. Errors: unavailable when the disk cannot be written.
  boost::asio::awaitable<Result<void>> note_sent(DesignId id, station::RobotId robot_id,
                                                 std::uint32_t controller_checksum);
  // The runs that were made with it; with a model: with the controllers that were designed for it. Newest first, at
  // most kMostRunsMadeWith.
  boost::asio::awaitable<std::vector<RunId>> runs_made_with(DesignId id);

  // The controllers that a run was made with, newest first: one, unless equal ones are kept. Empty: none is known.
  boost::asio::awaitable<std::vector<ControllerOfRun>> controllers_of(RunId run);

  // Its parent, the parent of that, and so on.
  boost::asio::awaitable<std::vector<Design>> ancestors(DesignId id);

 private:
  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
};

}  // namespace server::storage
