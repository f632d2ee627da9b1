// Asks the file system, and says what changed.
#include "server/storage/upkeep/disk_watch.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <system_error>

#include "server/config/file_system.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/storage/database/disk_reserve.hpp"

namespace server::storage {
namespace asio = boost::asio;
namespace fs = std::filesystem;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kLookInterval = 5s, kWarnInterval = 1h;
constexpr std::uint64_t kMegabyte = 1'000'000;

}  // namespace

const char* text(SpaceState value) {
  switch (value) {
    case SpaceState::ok: return "ok";
    case SpaceState::low: return "low";
    case SpaceState::critical: return "critical";
  }
  return "ok";
}

SpaceLimits space_limits(const config::RecordingConfig& config) {
  return {config.low_space_mb * kMegabyte, config.critical_space_mb * kMegabyte};
}

SpaceState next_state(SpaceState now, std::uint64_t free_bytes, SpaceLimits limits) {
  const auto below = [free_bytes](std::uint64_t limit, bool is_so) {
    return free_bytes < (is_so ? limit + limit / 10 : limit);
  };
  if (below(limits.critical_bytes, now == SpaceState::critical)) return SpaceState::critical;
  return below(limits.low_bytes, now != SpaceState::ok) ? SpaceState::low : SpaceState::ok;
}

std::uint64_t free_bytes_of(const fs::path& folder) { return fs::space(folder).available; }

std::uint64_t file_bytes(const fs::path& path) {
  std::error_code absent;
  const auto size = fs::file_size(path, absent);
  return absent ? 0 : size;
}

DiskWatch::DiskWatch(runtime::Clock& clock, runtime::WorkerThread& readers, fs::path database, SpaceLimits limits)
    : clock_{clock}, readers_{readers}, database_{std::move(database)}, limits_{limits} {
  file_system_ = [](const fs::path& folder) { return config::unsuitable_file_system(folder); };
}

asio::awaitable<void> DiskWatch::run() {
  std::int64_t warned_at_us = clock_.steady_us() - kWarnInterval.count();
  for (;;) {
    if (clock_.steady_us() - warned_at_us >= kWarnInterval.count()) {
      warned_at_us = clock_.steady_us();
      co_await warn_of_file_system();
    }
    co_await clock_.sleep_for(kLookInterval);
    co_await look();
  }
}

asio::awaitable<void> DiskWatch::warn_of_file_system() {
  const fs::path folder = fs::absolute(database_).parent_path();
  auto ask = [file_system = file_system_, folder] { return file_system(folder); };
  const std::string unsuitable = co_await readers_.run(std::move(ask));
  if (!unsuitable.empty()) spdlog::warn("{}", config::unsuitable_in_words(unsuitable, folder));
}

asio::awaitable<void> DiskWatch::look() {
  auto job = [path = database_, before = use_, free_bytes = free_bytes_] {
    DiskUse use = before;  // a file system that does not answer is as it was
    use.database_bytes = file_bytes(path);
    use.is_writable = ::access(path.c_str(), W_OK) == 0;
    try {
      use.free_bytes = free_bytes(fs::absolute(path).parent_path());
      keep_disk_reserve(path, use.free_bytes);
    } catch (const std::system_error& error) {
      spdlog::warn("the room on the disk cannot be told: {}", runtime::text_of(error));
    }
    return use;
  };
  use_ = co_await readers_.run(std::move(job));
  enter(next_state(state_, use_.free_bytes, limits_));
}

void DiskWatch::enter(SpaceState state) {
  if (state == state_) return;
  state_ = state;
  if (state == SpaceState::ok) {
    spdlog::info("there is room on the disk again: {} MB are free", use_.free_bytes / kMegabyte);
  } else {
    spdlog::log(state == SpaceState::low ? spdlog::level::warn : spdlog::level::err, "{}", problem());
  }
}

std::string DiskWatch::problem() const {
  if (state_ == SpaceState::ok) return {};
  return fmt::format("{} MB are free on the disk of {}, the {} limit is {} MB: make room{}",
                     use_.free_bytes / kMegabyte, database_.string(),
                     state_ == SpaceState::low ? "low_space_mb" : "critical_space_mb",
                     (state_ == SpaceState::low ? limits_.low_bytes : limits_.critical_bytes) / kMegabyte,
                     state_ == SpaceState::low ? "" : "; until then no run and no backup can be begun");
}

Result<void> DiskWatch::may_begin(const char* what) const {
  if (state_ != SpaceState::critical) return {};
  return fail(ErrorCode::unavailable, fmt::format("{} cannot be begun: {}", what, problem()), "low_space");
}

}  // namespace server::storage
