// Words between spaces.
#include "server/storage/export/export_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

namespace server::storage {
namespace {

constexpr std::array<std::pair<ErrorCode, std::string_view>, 11> kCodes{{
    {ErrorCode::bad_request, "bad_request"},
    {ErrorCode::invalid, "invalid"},
    {ErrorCode::unauthorized, "unauthorized"},
    {ErrorCode::forbidden, "forbidden"},
    {ErrorCode::not_found, "not_found"},
    {ErrorCode::conflict, "conflict"},
    {ErrorCode::rejected, "rejected"},
    {ErrorCode::not_connected, "not_connected"},
    {ErrorCode::timed_out, "timed_out"},
    {ErrorCode::unavailable, "unavailable"},
    {ErrorCode::internal, "internal"},
}};
constexpr std::size_t kMaxReasonBytes = 40;

// Up to the next space, which is taken away too.
std::string_view next_word(std::string_view& rest) {
  const std::size_t end = std::min(rest.find(' '), rest.size());
  const std::string_view word = rest.substr(0, end);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return word;
}

std::optional<std::uint64_t> number_in(std::string_view word) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return number;
}

std::optional<ExportLine> failure_in(std::string_view rest) {
  const std::string_view word = next_word(rest), reason = next_word(rest);
  const auto code = std::ranges::find(kCodes, word, &decltype(kCodes)::value_type::second);
  if (code == kCodes.end() || reason.empty() || reason.size() > kMaxReasonBytes || rest.empty()) return std::nullopt;
  return Error{code->first, std::string{rest}, reason == "-" ? "" : std::string{reason}};
}

std::string failure_text(const Error& error) {
  const auto code = std::ranges::find(kCodes, error.code, &decltype(kCodes)::value_type::first);
  std::string text =
      fmt::format("failed {} {} {}", code->second, error.reason.empty() ? "-" : error.reason, error.detail);
  std::ranges::replace(text, '\n', ' ');
  text.resize(std::min(text.size(), kMaxLineBytes));
  return text + '\n';
}

}  // namespace

std::string line_text(const ExportLine& line) {
  if (const auto* progress = std::get_if<ExportProgress>(&line)) {
    return fmt::format("progress {} {}\n", progress->passed, progress->total);
  }
  const auto* error = std::get_if<Error>(&line);
  return error != nullptr ? failure_text(*error) : "done\n";
}

std::optional<ExportLine> parse_export_line(std::string_view text) {
  if (text.size() > kMaxLineBytes) return std::nullopt;
  if (text == "done") return ExportDone{};
  const std::string_view kind = next_word(text);
  if (kind == "failed") return failure_in(text);
  if (kind != "progress") return std::nullopt;
  const auto passed = number_in(next_word(text)), total = number_in(text);
  if (!passed || !total || *passed > *total) return std::nullopt;
  return ExportProgress{*passed, *total};
}

}  // namespace server::storage
