// All parts of the recording, made and wired in one place: for main.cpp, the routes and the tests.
//
// Loop thread. Loop, clock and workers outlive it, and so does what is connected to it. Order of use: connect(),
// open(), spawn(); and after the loop's run() has returned, close().
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <filesystem>

#include "server/config/config.hpp"
#include "server/runtime/tasks.hpp"
#include "server/station/station.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/designs/designs.hpp"
#include "server/storage/export/export_slots.hpp"
#include "server/storage/finalizing/run_finalizer.hpp"
#include "server/storage/groups/group_maker.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/jobs/job_files.hpp"
#include "server/storage/jobs/jobs.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/reservations/reservation_book.hpp"
#include "server/storage/runs/fluid_models.hpp"
#include "server/storage/runs/markers.hpp"
#include "server/storage/runs/outside_references.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/run_metrics.hpp"
#include "server/storage/runs/runs.hpp"
#include "server/storage/upkeep/backup.hpp"
#include "server/storage/upkeep/disk_watch.hpp"
#include "server/storage/upkeep/head_watch.hpp"
#include "server/storage/upkeep/retention.hpp"

namespace server::storage {

struct RecordingParts {
  RecordingParts(boost::asio::io_context& loop, runtime::Clock& clock, runtime::WorkerThread& disk,
                 runtime::WorkerThread& readers, runtime::WorkerThread& exports_worker,
                 runtime::WorkerThread& checkpoints, const RecorderOptions& options,
                 const config::RecordingConfig& config = {});

  // The recording gets the station's reports from now on; the station gets what has become durable and what is missing.
  void connect(station::Station& station);

  // Opens or creates the database and reads what the station must know again; before robots arrive. Throws when the
  // file is not ours or cannot be written.
  boost::asio::awaitable<RestoredState> open();

  // Starts the lasting tasks.
  void spawn(runtime::TaskGroup& tasks);

  std::filesystem::path path() const { return path_; }                                       // of the database
  std::filesystem::path exports_folder() const { return path_.parent_path() / ".exports"; }  // empty after open()

  // Every sample that was received is on disk afterwards and open runs are interrupted, or it is logged why not. Does
  // not throw.
  void close();

  Recorder recorder;
  HeadWatch head_watch;
  DatabaseReader reader;
  RemovalClock removal_clock;  // by which things grow old
  RunDigester digester;
  RunFinalizer finalizer;
  Runs runs;
  Markers markers;
  OutsideReferences references;
  FluidModels fluid_models;
  MetricsOfRuns metrics;
  Designs designs;
  ReservationBook reservations;
  Jobs jobs;
  History history;
  History exports;           // the same on a worker of its own, so that no page waits behind an export
  ExportSlots export_slots;  // of files that are written in another program
  JobFiles job_files;
  DiskWatch disk_watch;
  Backups backups;
  Retention retention;
  GroupMaker groups;

 private:
  std::filesystem::path path_;
};

}  // namespace server::storage
