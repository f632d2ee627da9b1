// Reads the run and writes the file, whatever the format, from beginning to end.
//
// Blocks. The database is opened for reading only (query/run_reader). Errors: those of read_store, not_found for a run
// that is not there, invalid for what the format does not hold; throws when the disk does not take the file.
#pragma once

#include <functional>

#include "server/runtime/result.hpp"
#include "server/storage/export/export_lines.hpp"
#include "server/storage/export/export_order.hpp"

namespace server::exporter {

// `report` is called at least every 100 ms of work.
Result<void> write_export(const storage::ExportOrder& order,
                          const std::function<void(const storage::ExportProgress&)>& report);

}  // namespace server::exporter
