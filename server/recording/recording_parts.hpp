// All parts of the recording, made and wired in one place: for main.cpp, the routes and the tests.
//
// Loop thread. Loop, clock and workers outlive it, and so does what is connected to it. Order of use: connect(),
// open(), spawn(); and after the loop's run() has returned, close().
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <filesystem>

#include "server/recording/certifier.hpp"
#include "server/recording/database_reader.hpp"
#include "server/recording/history.hpp"
#include "server/recording/markers.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/runs.hpp"
#include "server/station/station.hpp"
#include "server/tasks.hpp"

namespace server {

struct RecordingParts {
  RecordingParts(boost::asio::io_context& loop, Clock& clock, WorkerThread& disk, WorkerThread& readers,
                 WorkerThread& checkpoints, const RecorderOptions& options);

  // The station is heard from now on, and hears what has become durable and what is missing.
  void connect(Station& station);

  // Opens or creates the database and reads what the station must know again; before robots arrive. Throws when the
  // file is not ours or cannot be written.
  boost::asio::awaitable<RestoredState> open();

  // Starts the lasting tasks.
  void spawn(TaskGroup& tasks);

  // Every sample that was received is on disk afterwards and open runs are interrupted, or it is logged why not. Does
  // not throw.
  void close();

  Recorder recorder;
  DatabaseReader reader;
  Certifier certifier;
  Runs runs;
  Markers markers;
  History history;

 private:
  std::filesystem::path path_;
};

}  // namespace server
