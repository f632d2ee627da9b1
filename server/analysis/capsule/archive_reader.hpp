// Reads a zip archive: its entries one by one, each hashed, and the seal of archive_writer.hpp.
//
// The archive may be anybody's: nothing is written to a path that it names, no two entries may have one name, and all
// that is read of it may be kMostExpansion times as long as the file, or kAlwaysAllowedBytes. Errors: what is damaged
// is in the result of the call; throws std::runtime_error for a file that is no zip archive.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"

namespace server::analysis {

enum class Seal : std::uint8_t { whole, broken, none };

inline constexpr std::uint64_t kMostExpansion = 100, kAlwaysAllowedBytes = 1 << 28;
inline constexpr std::size_t kMostEntries = 1000;

class ArchiveReader {
 public:
  explicit ArchiveReader(std::filesystem::path path);
  ~ArchiveReader();
  ArchiveReader(const ArchiveReader&) = delete;
  ArchiveReader& operator=(const ArchiveReader&) = delete;

  std::vector<std::string> names();  // in the order of its directory; fewer if that is damaged
  // The first fault of the names: too many, one twice, one that climbs or is no plain path. Empty: there is none.
  std::string fault_of_names();

  // The entry in pieces to `take`; then its SHA-256. invalid: it is not there, or damaged.
  Result<std::string> read(const std::string& name, const std::function<void(const std::string& piece)>& take);
  // As text, at most so long.
  Result<std::string> text(const std::string& name, std::size_t most_bytes);

  Seal seal() const;  // reads the whole archive

 private:
  std::filesystem::path path_;
  void* zip_ = nullptr;  // of minizip
  std::uint64_t unpacked_bytes_ = 0;
};

}  // namespace server::analysis
