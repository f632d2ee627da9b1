// The job `export`: a run as a file that is kept for a while.
//
// Loop thread; the file is written by a program of its own (storage/export/export_child), which a cancelled job ends.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <filesystem>
#include <string>

#include "server/runtime/result.hpp"
#include "server/storage/export/export_format.hpp"
#include "server/storage/export/export_rows.hpp"
#include "server/storage/export/export_slots.hpp"
#include "server/storage/jobs/job_files.hpp"
#include "server/storage/jobs/job_run.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/upkeep/disk_watch.hpp"

namespace server::analysis {

struct ExportParts {
  storage::History& exports;  // on a worker of its own
  storage::DiskWatch& disk_watch;
  storage::JobFiles& files;
  storage::ExportSlots& slots;
  std::filesystem::path database;
};

struct ExportRequest {
  storage::ExportQuery query;
  storage::ExportFormat format = storage::ExportFormat::csv;
};

// Writes the draft of the job. Errors: no such run, no room.
boost::asio::awaitable<Result<void>> write_export(ExportParts parts, ExportRequest request, storage::JobRun& run);

}  // namespace server::analysis
