// What a disk may hold after the power failed: of each file what was synced, and some of what was not.
//
//   file:  durable bytes, then the writes and truncations since the last sync, in their order
//   name:  the file it stands for now, and the one it stands for on the disk
//
// A sync makes durable the whole file and its name, as ext4, XFS and btrfs do; a removal is durable with the next sync
// of the folder. Until the power fails the real files hold all of it; then lose_power() rewrites them.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace server {

constexpr std::uint64_t kDiskSectorBytes = 512;

// What survives of the changes that were not synced.
enum class Survival : std::uint8_t {
  nothing,  // none of them
  sectors,  // any of the sectors, each with any of its contents; bytes beside a write are never harmed
  torn,     // the same, and a sector that was written to may be half old and half new, or noise from end to end
};
const char* text(Survival value);

class DiskFile {
 public:
  explicit DiskFile(std::string durable = {}) : durable_{std::move(durable)} {}

  void write(std::uint64_t offset, std::string_view bytes) { changes_.push_back({offset, std::string{bytes}, false}); }
  void truncate(std::uint64_t size) { changes_.push_back({size, {}, true}); }
  void sync();

  std::string after_power_cut(Survival survival, std::mt19937& random) const;

 private:
  struct Change {
    std::uint64_t offset = 0;
    std::string bytes;
    bool truncates = false;  // to `offset` bytes
  };

  std::string durable_;
  std::vector<Change> changes_;
};

class ForgetfulDisk {
 public:
  // The file that has this name now; a new one if there is none. One that is on the disk and was never opened before is
  // taken as it is, durable.
  std::shared_ptr<DiskFile> open(const std::string& path);
  bool exists(const std::string& path) const { return now_.contains(path); }
  void remove(const std::string& path) { now_.erase(path); }

  void sync(const std::string& path, const std::shared_ptr<DiskFile>& file);
  void sync_folder() { durable_ = now_; }

  // Rewrites every file that was opened, and removes the indexes of logs (`-shm`), which are memory. None may be open.
  void lose_power(Survival survival, std::mt19937& random);

 private:
  using Names = std::map<std::string, std::shared_ptr<DiskFile>>;

  Names now_;
  Names durable_;
};

}  // namespace server
