// Refuses, or warns.
#include "server/config/station_folder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <stdexcept>

#include "server/config/file_system.hpp"
#include "server/config/resource_limits.hpp"

namespace server::config {

DataFolder station_folder(const Config& config) {
  const std::string unsuitable = unsuitable_file_system(config.data_dir);
  if (!unsuitable.empty() && !config.any_file_system && !std::filesystem::exists(config.database())) {
    throw std::runtime_error{fmt::format("nothing was made: {}, or take it all the same with --any-file-system",
                                         unsuitable_in_words(unsuitable, config.data_dir))};
  }
  for (const TightLimit& limit : tight_limits(own_limits(), config)) spdlog::warn("{}; {}", limit.what, limit.action);
  return DataFolder{config.data_dir};
}

}  // namespace server::config
