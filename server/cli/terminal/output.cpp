// Text of tables, JSON and CSV.
#include "server/cli/terminal/output.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

namespace server::cli {
namespace {

// In characters, not bytes.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

constexpr char kToTheLeft = '<';

std::string shown(const std::string& text) { return text.starts_with(kToTheLeft) ? text.substr(1) : text; }

}  // namespace

void add_json_flag(CLI::App& command, OutputForm& form) { command.add_flag("--json", form.is_json, "Answer in JSON"); }

void add_json_and_csv_flags(CLI::App& command, OutputForm& form) {
  auto* json = command.add_flag("--json", form.is_json, "Answer in JSON");
  command.add_flag("--csv", form.is_csv, "Answer in CSV")->excludes(json);
}

void write_json(std::ostream& out, const nlohmann::ordered_json& object) {
  const char* before = "{";
  for (const auto& [key, value] : object.items()) {
    fmt::print(out, "{}\n  {}: {}", before, nlohmann::json(key).dump(),
               value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    before = ",";
  }
  fmt::print(out, "\n}}\n");
}

void write_csv(std::ostream& out, std::initializer_list<CsvColumn> columns) {
  const char* before = "";
  for (const CsvColumn& column : columns) fmt::print(out, "{}{}", std::exchange(before, ","), column.name);
  out << '\n';
  const std::size_t rows = columns.size() == 0 ? 0 : columns.begin()->values.size();
  for (std::size_t i = 0; i < rows; ++i) {
    before = "";
    for (const CsvColumn& column : columns) {
      out << std::exchange(before, ",");
      if (std::isfinite(column.values[i])) fmt::print(out, "{}", column.values[i]);
    }
    out << '\n';
  }
}

void Table::write(std::ostream& out) const {
  std::vector<std::size_t> widths;
  for (const auto& row : rows_) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width_of(shown(row[i])));
  }
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string text = shown(row[i]);
      const std::string padding(widths[i] - width_of(text), ' ');
      const bool is_left = i == 0 || rows_.front()[i].starts_with(kToTheLeft);
      line += (i == 0 ? "" : "  ") + (is_left ? text + padding : padding + text);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out << line << '\n';
  }
}

std::string cell(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}g}", value == 0 ? 0 : value, digits) : "-";
}

std::string fixed(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  std::string text = fmt::format("{:.{}f}", value, decimals);
  const bool is_zero = text.find_first_not_of("-0.") == std::string::npos;
  return is_zero && text.front() == '-' ? text.substr(1) : text;
}

std::string cell(const std::optional<double>& value, int digits) { return value ? cell(*value, digits) : "-"; }

int not_done(int exit_status, std::string_view outcome) {
  fmt::print(stderr, "rheonaut: {}\n", one_line(outcome));
  return exit_status;
}

// Also the control characters of C1, two bytes of UTF-8, which terminals obey as they obey an escape.
std::string one_line(std::string_view text) {
  std::string shown;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const auto byte = static_cast<unsigned char>(text[at]);
    const auto next = at + 1 < text.size() ? static_cast<unsigned char>(text[at + 1]) : 0U;
    const bool is_c1 = byte == 0xC2 && next >= 0x80 && next < 0xA0;
    if (is_c1) ++at;
    shown += is_c1                         ? fmt::format("\\x{:02X}", next)
             : byte < 0x20 || byte == 0x7F ? fmt::format("\\x{:02X}", byte)
                                           : std::string{text[at]};
  }
  return shown;
}

}  // namespace server::cli
