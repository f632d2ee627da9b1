// The formats of an export file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace server::storage {

enum class ExportFormat : std::uint8_t { csv, mat, sqlite, mcap };

inline constexpr std::array kExportFormats{ExportFormat::csv, ExportFormat::mat, ExportFormat::sqlite,
                                           ExportFormat::mcap};

const char* text(ExportFormat value);
std::optional<ExportFormat> parse_export_format(std::string_view text);  // none: there is no such format

// A grid of equal steps is for formats of one table.
constexpr bool may_have_grid(ExportFormat format) { return format == ExportFormat::csv || format == ExportFormat::mat; }

}  // namespace server::storage
