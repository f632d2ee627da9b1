// Reads columns of numbers out of CSV text, by name.
//
//   text = { remark | empty } heading { row | remark | empty }       lines end with LF or CRLF
//   remark = "#" ...            heading, row = cell { separator cell }
//   separator = "," or, if the heading has no comma, ";" or tab          cell: spaces and quotes around it are dropped
//
// Columns may stand in any order, others beside them. Only the cells of wanted columns are read. A row has no more
// cells than the heading, except for one empty cell at its end; a separator inside quotes separates nothing. A column
// named duty lies in [-1, 1].
// Errors: throws std::runtime_error naming source, line, column and cell.
#pragma once

#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace server::analysis {

inline constexpr std::size_t kMaxCsvRows = 2'000'000;

// By name; all have the same length.
using CsvColumns = std::map<std::string, std::vector<double>, std::less<>>;

// `source` names the text in messages. All of `required` are in the answer, and those of `optional` and `with_gaps`
// that there are. An empty cell is refused, but is NaN in a column of `with_gaps`.
CsvColumns parse_csv(std::string_view text, const std::string& source, std::initializer_list<const char*> required,
                     std::initializer_list<const char*> optional = {},
                     std::initializer_list<const char*> with_gaps = {});

}  // namespace server::analysis
