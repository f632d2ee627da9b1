// The names of the table of telemetry fields as lists.
#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "server/station/state/telemetry_fields.hpp"

namespace server {

using Names = std::vector<std::string>;

inline Names sample_names() {
  Names names;
  station::for_each_sample_field([&](const auto& field) { names.emplace_back(field.name); });
  return names;
}

inline Names batch_names() {
  Names names;
  station::for_each_batch_field([&](const auto& field) { names.emplace_back(field.name); });
  return names;
}

// A file of the project, by its path from the root.
inline std::string project_file(const std::string& path) {
  std::ifstream in{std::string{PROJECT_DIR} + "/" + path};
  return {std::istreambuf_iterator<char>{in}, {}};
}

}  // namespace server
