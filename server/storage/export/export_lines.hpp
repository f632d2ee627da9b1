// What the export program tells the program that started it: lines on its standard output.
//
//   line    := "progress " passed " " total "\n"       samples of the run, lost ones too; at least every 100 ms of work
//            | "done\n"                                 the file is whole; the last line
//            | "failed " code " " reason " " detail "\n"    there is no file; the last line
//   code    := a name of ErrorCode                     reason := a word, "-" for none
//   detail  := one line of text                        total  := 0 while it is not known
//
// A line has at most kMaxLineBytes. Anything else is refused: the reader trusts the writer no further than this.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "server/runtime/result.hpp"

namespace server::storage {

struct ExportProgress {
  std::uint64_t passed = 0;
  std::uint64_t total = 0;
  double share() const { return total == 0 ? 0 : static_cast<double>(passed) / static_cast<double>(total); }
  bool operator==(const ExportProgress&) const = default;
};
struct ExportDone {
  bool operator==(const ExportDone&) const = default;
};
using ExportLine = std::variant<ExportProgress, ExportDone, Error>;

inline constexpr std::size_t kMaxLineBytes = 2000;

std::string line_text(const ExportLine& line);                       // with its end; a detail is cut to fit
std::optional<ExportLine> parse_export_line(std::string_view text);  // without its end

}  // namespace server::storage
