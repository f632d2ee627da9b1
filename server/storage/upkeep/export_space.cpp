// Bytes that are free against bytes that are needed.
#include "server/storage/upkeep/export_space.hpp"

#include <fmt/format.h>

#include "server/storage/upkeep/disk_watch.hpp"

namespace server::storage {
namespace {

constexpr std::uint64_t kSampleBytes = 700;                  // at most, in any format's file
constexpr std::uint64_t kSpareBytes = 512ULL * 1024 * 1024;  // that the recording goes on with

}  // namespace

Result<void> room_for_export(const std::filesystem::path& folder, std::uint64_t samples) {
  const std::uint64_t free_bytes = free_bytes_of(folder);
  const std::uint64_t wanted = 2 * samples * kSampleBytes + kSpareBytes;
  if (free_bytes >= wanted) return {};
  return fail(ErrorCode::unavailable,
              fmt::format("the export needs up to {} MB on the station's disk, {} MB are free; export CSV, which "
                          "needs none",
                          wanted / 1'000'000, free_bytes / 1'000'000),
              "low_space");
}

Result<void> room_for_more(const std::filesystem::path& folder) {
  if (free_bytes_of(folder) >= kSpareBytes) return {};
  return fail(ErrorCode::unavailable, "the export would fill the station's disk; export CSV, which needs no room",
              "low_space");
}

}  // namespace server::storage
