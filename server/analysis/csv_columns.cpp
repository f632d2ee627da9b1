// A line at a time; numbers by from_chars, so that no locale matters.
#include "server/analysis/csv_columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace server::analysis {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::size_t kMaxQuotedCell = 40;
constexpr const char* kDuty = "duty";  // the one column whose range is known

std::string_view trimmed(std::string_view cell) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!cell.empty() && is_space(cell.front())) cell.remove_prefix(1);
  while (!cell.empty() && is_space(cell.back())) cell.remove_suffix(1);
  if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') cell = trimmed(cell.substr(1, cell.size() - 2));
  return cell;
}

// The end of the cell that begins at `begin`: the next separator that stands outside quotes.
std::size_t end_of_cell(std::string_view line, std::size_t begin, char separator) {
  bool is_quoted = false;
  for (std::size_t i = begin; i < line.size(); ++i) {
    if (line[i] == '"') is_quoted = !is_quoted;
    if (line[i] == separator && !is_quoted) return i;
  }
  return std::string_view::npos;
}

std::vector<std::string_view> cells_of(std::string_view line, char separator) {
  std::vector<std::string_view> cells;
  for (std::size_t begin = 0;;) {
    const std::size_t end = end_of_cell(line, begin, separator);
    cells.push_back(trimmed(line.substr(begin, end - begin)));
    if (end == std::string_view::npos) return cells;
    begin = end + 1;
  }
}

char separator_of(std::string_view heading) {
  for (const char separator : {',', ';', '\t'}) {
    if (heading.find(separator) != std::string_view::npos) return separator;
  }
  return ',';
}

class Reader {
 public:
  Reader(const std::string& source, std::initializer_list<const char*> required,
         std::initializer_list<const char*> optional, std::initializer_list<const char*> with_gaps)
      : source_{source}, required_{required}, optional_{optional}, with_gaps_{with_gaps} {}

  void take(std::string_view line) {
    ++line_;
    const std::string_view content = trimmed(line);
    if (content.empty() || content.front() == '#') return;
    has_heading_ ? take_row(line) : take_heading(line);
  }

  CsvColumns end() {
    if (!has_heading_) refuse(fmt::format("has no heading; its first line must name the columns {}", wanted()));
    return std::move(columns_);
  }

 private:
  struct Column {
    std::size_t index = 0;
    std::vector<double>* values = nullptr;
    std::string name;
  };

  [[noreturn]] void refuse(const std::string& why) const {
    throw std::runtime_error{fmt::format("{} {}", source_, why)};
  }
  [[noreturn]] void refuse_line(const std::string& why) const { refuse(fmt::format("line {}: {}", line_, why)); }

  std::string wanted() const { return fmt::format("{}", fmt::join(required_, ", ")); }

  bool may_have_gaps(std::string_view name) const {
    return std::ranges::any_of(with_gaps_, [name](const char* other) { return name == other; });
  }

  bool wants(std::string_view name) const {
    const auto same = [name](const char* other) { return name == other; };
    return std::ranges::any_of(required_, same) || std::ranges::any_of(optional_, same) || may_have_gaps(name);
  }

  void take_heading(std::string_view line) {
    separator_ = separator_of(line);
    const auto names = cells_of(line, separator_);
    headings_ = names.size();
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!wants(names[i])) continue;
      const std::string name{names[i]};
      if (columns_.contains(name)) refuse_line(fmt::format("column {} stands twice in the heading", name));
      chosen_.push_back({i, &columns_[name], name});
    }
    for (const char* name : required_) {
      if (!columns_.contains(name)) {
        refuse_line(fmt::format("column {} is missing in the heading '{}'; needed are {}", name,
                                trimmed(line).substr(0, 2 * kMaxQuotedCell), wanted()));
      }
    }
    has_heading_ = true;
  }

  void take_row(std::string_view line) {
    if (++rows_ > kMaxCsvRows) refuse(fmt::format("has more than {} rows", kMaxCsvRows));
    auto cells = cells_of(line, separator_);
    if (cells.size() == headings_ + 1 && cells.back().empty()) cells.pop_back();
    if (cells.size() > headings_) {
      refuse_line(
          fmt::format("has {} cells, the heading has {}; decimal comma? use ; between cells", cells.size(), headings_));
    }
    for (const Column& column : chosen_) {
      if (column.index >= cells.size()) {
        refuse_line(fmt::format("has {} cells, column {} is number {}", cells.size(), column.name, column.index + 1));
      }
      column.values->push_back(number(cells[column.index], column.name));
    }
  }

  double number(std::string_view cell, const std::string& column) const {
    if (cell.empty() && may_have_gaps(column)) return std::numeric_limits<double>::quiet_NaN();
    if (cell.starts_with('+')) cell.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value)) {
      refuse_line(fmt::format("'{}' in column {} is not a finite number", cell.substr(0, kMaxQuotedCell), column));
    }
    if (column == kDuty && std::abs(value) > 1) {
      refuse_line(fmt::format("duty {} is outside [-1, 1]; is it in percent?", value));
    }
    return value;
  }

  const std::string& source_;
  std::vector<const char*> required_, optional_, with_gaps_;
  std::size_t line_ = 0, rows_ = 0, headings_ = 0;
  bool has_heading_ = false;
  char separator_ = ',';
  CsvColumns columns_;  // nodes stay where they are: chosen_ points into it
  std::vector<Column> chosen_;
};

}  // namespace

CsvColumns parse_csv(std::string_view text, const std::string& source, std::initializer_list<const char*> required,
                     std::initializer_list<const char*> optional, std::initializer_list<const char*> with_gaps) {
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  Reader reader{source, required, optional, with_gaps};
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    reader.take(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return reader.end();
}

}  // namespace server::analysis
