// All parts of the recording, made and wired in one place: for main.cpp, the routes and the tests.
//
// Loop thread. Loop, clock and workers outlive it, and so does what is connected to it. Order of use: connect(),
// open(), spawn(); and after the loop's run() has returned, close().
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>

#include "server/config.hpp"
#include "server/recording/backup.hpp"
#include "server/recording/disk_watch.hpp"
#include "server/recording/history.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/retention.hpp"
#include "server/recording/runs.hpp"
#include "server/station/station.hpp"
#include "server/tasks.hpp"

namespace server {

struct RecordingParts {
  RecordingParts(boost::asio::io_context& loop, Clock& clock, WorkerThread& disk, WorkerThread& readers,
                 WorkerThread& checkpoints, const RecorderOptions& options, const RecordingConfig& config = {});

  // The station is heard from now on, and hears what has become durable and what is missing.
  void connect(Station& station);

  // Opens or creates the database and reads what the station must know again; before robots arrive. Throws when the
  // file is not ours or cannot be written.
  boost::asio::awaitable<RestoredState> open();

  // Starts the lasting tasks.
  void spawn(TaskGroup& tasks);

  // Every sample that was received is on disk afterwards, or it is logged why not. Does not throw.
  void close();

  Recorder recorder;
  Runs runs;
  History history;
  DiskWatch disk_watch;
  Backups backups;
  Retention retention;
};

}  // namespace server
