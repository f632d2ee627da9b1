// The migrations as they were embedded: one file each, in order.
#include "server/storage/database/schema.hpp"

#include <vector>

namespace server::storage {

std::span<const char* const> migrations() {
  static const std::vector<const char*> kScripts = [] {
    std::vector<const char*> all;
    for (const base::EmbeddedFile& file : migration_files()) all.push_back(file.content.data());
    return all;
  }();
  return kScripts;
}

}  // namespace server::storage
