// Watches the room on the database's disk: warns when it gets low, lets nothing new begin when it is critical, and
// keeps the reserve for the next start (disk_reserve).
//
// Recording and commands go on whatever it says: only a commit that fails stops recording. It recovers by itself.
// Loop thread; the disk is asked on the readers' thread. Clock and worker outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <filesystem>
#include <functional>

#include "server/config/config.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/worker.hpp"

namespace server::storage {

enum class SpaceState : std::uint8_t {
  ok,
  low,       // less than recording.low_space_mb
  critical,  // less than recording.critical_space_mb: no new runs, no backups
};
const char* text(SpaceState value);

struct SpaceLimits {
  std::uint64_t low_bytes = 0;
  std::uint64_t critical_bytes = 0;
};
SpaceLimits space_limits(const config::RecordingConfig& config);

// A state is left for a better one when there is a tenth more than its limit.
SpaceState next_state(SpaceState now, std::uint64_t free_bytes, SpaceLimits limits);

struct DiskUse {
  std::uint64_t free_bytes = 0;      // for this user
  std::uint64_t database_bytes = 0;  // of the file
  bool is_writable = true;           // this user may write the file, as far as the file system says
};

// How many bytes this user may still write into a folder. Throws std::system_error.
std::uint64_t free_bytes_of(const std::filesystem::path& folder);
std::uint64_t file_bytes(const std::filesystem::path& path);  // 0 when it is not there

class DiskWatch {
 public:
  using FreeBytes = std::function<std::uint64_t(const std::filesystem::path& folder)>;
  using FileSystem = std::function<std::string(const std::filesystem::path& folder)>;

  DiskWatch(runtime::Clock& clock, runtime::WorkerThread& readers, std::filesystem::path database, SpaceLimits limits);

  // Looks every 5 s, until cancelled; and each hour at the file system, which may be one that damages a store.
  boost::asio::awaitable<void> run();
  boost::asio::awaitable<void> look();

  SpaceState state() const { return state_; }
  const DiskUse& use() const { return use_; }
  // What people read; empty while there is room.
  std::string problem() const;
  // An error while it is critical; `what` cannot be begun then, e.g. "a run".
  Result<void> may_begin(const char* what) const;

  // Another way to ask the disk, from the next look on: for tests. Called on the readers' thread.
  void set_free_bytes(FreeBytes free_bytes) { free_bytes_ = std::move(free_bytes); }
  // Another unsuitable_file_system(): for tests, as above.
  void set_file_system(FileSystem file_system) { file_system_ = std::move(file_system); }

 private:
  void enter(SpaceState state);
  boost::asio::awaitable<void> warn_of_file_system();

  runtime::Clock& clock_;
  runtime::WorkerThread& readers_;
  std::filesystem::path database_;
  SpaceLimits limits_;
  FreeBytes free_bytes_ = free_bytes_of;
  FileSystem file_system_;
  SpaceState state_ = SpaceState::ok;
  DiskUse use_;
};

}  // namespace server::storage
