// The options that say how runs are aligned and on which grid, and the query that they become.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/analysis/comparison/alignment.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct TraceOptions {
  analysis::AlignAt at = analysis::AlignAt::start;
  int number = 1;
  std::string event, marker;  // empty: not given
  std::optional<double> grid_s, from_s, to_s;
  std::optional<std::int64_t> reference;
};

void add_options(CLI::App& command, TraceOptions& options);

// "runs=3,4&at=step&number=1"
std::string query_of(const std::vector<std::int64_t>& runs, const TraceOptions& options);

}  // namespace server::cli
