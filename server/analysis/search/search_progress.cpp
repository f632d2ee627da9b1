// Reads a search's own counts.
#include "server/analysis/search/search_progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "control/identification/identifiability.hpp"

namespace server::analysis {
namespace {

constexpr double kOfOneSearch = 0.8;  // of what is left

// Structures are searched in this order.
int index_of(control::Structure structure) {
  if (structure == control::Structure::first_order) return 0;
  return structure == control::Structure::second_order ? 1 : 2;
}

std::string purpose_of(const control::Progress& progress) {
  if (progress.is_for_dead_zone && progress.is_for_dead_time) return "for a dead zone and a dead time, ";
  if (progress.is_for_dead_zone) return "for a dead zone, ";
  return progress.is_for_dead_time ? "for a dead time, " : "";
}

}  // namespace

std::string in_words(const control::Progress& progress) {
  const std::string purpose = purpose_of(progress);
  if (progress.starts == 0) return purpose + "before the first start";
  return fmt::format("{}{}: start {} of {}, iteration {}", purpose, control::structure_name(progress.structure),
                     progress.start + 1, progress.starts, progress.iteration);
}

double SearchShare::at(const control::Progress& progress) {
  double within = 0;
  if (progress.starts > 0) {
    const int index = structures_ == 1 ? 0 : index_of(progress.structure);
    within = (index + static_cast<double>(progress.start) / progress.starts) / structures_;
  }
  const int before = (progress.is_for_dead_time ? 1 : 0) + (progress.is_for_dead_zone ? 2 : 0);
  largest_ = std::max(largest_, 1 - (1 - kOfOneSearch * within) * std::pow(1 - kOfOneSearch, before));
  return largest_;
}

}  // namespace server::analysis
