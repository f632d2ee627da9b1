// The output of a tool: a table for people, JSON or CSV for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace server::cli {

// Neither: a table.
struct OutputForm {
  bool is_json = false;
  bool is_csv = false;
};

void add_json_flag(CLI::App& command, OutputForm& form);
void add_json_and_csv_flags(CLI::App& command, OutputForm& form);

// One line per member, numbers with all their digits.
void write_json(std::ostream& out, const nlohmann::ordered_json& object);

struct CsvColumn {
  const char* name;
  std::span<const double> values;
};
void write_csv(std::ostream& out, std::initializer_list<CsvColumn> columns);

// Aligned columns: the first to the left, the others to the right unless their heading begins with "<".
class Table {
 public:
  explicit Table(std::vector<std::string> head) { row(std::move(head)); }
  void row(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  void write(std::ostream& out) const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

// In a table of parameters, beside the sigma of one at its bound; the column is there where it is needed.
inline constexpr const char* kSigmaAtBound = "means little: the parameter lies at its bound";

// An outcome that is not success: says it in one line on standard error, beside whatever the answer is, and returns the
// exit status.
int not_done(int exit_status, std::string_view outcome);

// For messages: what a terminal would obey, or what would break the line, as \xNN.
std::string one_line(std::string_view text);

// For tables: as many significant digits as a reader wants, "-" for what is not there.
std::string cell(double value, int digits = 6);
std::string fixed(double value, int decimals);  // with this many decimals, and no sign on zero
std::string cell(const std::optional<double>& value, int digits = 6);

}  // namespace server::cli
