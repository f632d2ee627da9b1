#include "server/storage/export/export_slots.hpp"

#include <fmt/format.h>

namespace server::storage {

Result<void> ExportSlots::may_begin() const {
  if (taken < kMostExportFiles) return {};
  return fail(ErrorCode::unavailable,
              fmt::format("{} export files are being written, the most at a time; ask again when one is done", taken),
              "busy");
}

}  // namespace server::storage
