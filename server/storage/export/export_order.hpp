// What the export program is asked to write, and the same as its arguments.
//
//   rheonaut-export DATABASE RUN FORMAT FILE CHANNELS GRID_US PARENT
//
// CHANNELS: names with commas between them, "-" for none; GRID_US: 0 for every sample; PARENT: the process that starts
// it, and with which it ends.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/storage/export/export_format.hpp"
#include "server/storage/export/export_rows.hpp"

namespace server::storage {

struct ExportOrder {
  std::filesystem::path database;
  ExportFormat format = ExportFormat::csv;
  ExportQuery query;
  std::filesystem::path file;  // replaced if it is there
};

struct ReceivedOrder {
  ExportOrder order;
  pid_t parent = 0;
};

std::vector<std::string> export_arguments(const ExportOrder& order, pid_t parent);
// invalid: quotes what is wrong.
Result<ReceivedOrder> parse_export_arguments(const std::vector<std::string>& arguments);

}  // namespace server::storage
