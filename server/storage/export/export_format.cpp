#include "server/storage/export/export_format.hpp"

namespace server::storage {

const char* text(ExportFormat value) {
  switch (value) {
    case ExportFormat::csv: return "csv";
    case ExportFormat::mat: return "mat";
    case ExportFormat::sqlite: return "sqlite";
    case ExportFormat::mcap: return "mcap";
  }
  return "";
}

std::optional<ExportFormat> parse_export_format(std::string_view word) {
  for (const ExportFormat format : kExportFormats) {
    if (word == text(format)) return format;
  }
  return std::nullopt;
}

}  // namespace server::storage
