// What a board keeps over resets, in memory, for tests.
#pragma once

#include <map>
#include <vector>

#include "robot_fw/core/settings_store.hpp"

namespace robot_fw {

class MemoryStorage final : public Storage {
 public:
  std::size_t load(StorageKey key, std::uint8_t* bytes, std::size_t capacity) override {
    const auto found = values.find(key);
    if (found == values.end() || found->second.size() > capacity) return 0;
    std::copy(found->second.begin(), found->second.end(), bytes);
    return found->second.size();
  }
  bool save(StorageKey key, protocol::Bytes bytes) override {
    ++saves;
    if (is_full) return false;
    values[key].assign(bytes.begin(), bytes.end());
    return true;
  }
  bool damaged() const override { return is_damaged; }

  std::map<StorageKey, std::vector<std::uint8_t>> values;
  int saves = 0;
  bool is_full = false, is_damaged = false;
};

}  // namespace robot_fw
