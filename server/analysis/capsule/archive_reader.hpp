// Reads a zip archive: its entries one by one, each hashed, and the seal of archive_writer.hpp.
//
// Nothing is written to a path that the archive names. Errors: what is damaged is in the result of the call; throws
// std::runtime_error for a file that is no zip archive.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"

namespace server::analysis {

enum class Seal : std::uint8_t { whole, broken, none };

class ArchiveReader {
 public:
  explicit ArchiveReader(std::filesystem::path path);
  ~ArchiveReader();
  ArchiveReader(const ArchiveReader&) = delete;
  ArchiveReader& operator=(const ArchiveReader&) = delete;

  std::vector<std::string> names();  // in the order of its directory; fewer if that is damaged

  // The entry in pieces to `take`; then its SHA-256. invalid: it is not there, or damaged.
  Result<std::string> read(const std::string& name, const std::function<void(const std::string& piece)>& take);
  // As text, at most so long.
  Result<std::string> text(const std::string& name, std::size_t most_bytes);

  Seal seal() const;  // reads the whole archive

 private:
  std::filesystem::path path_;
  void* zip_ = nullptr;  // of minizip
};

}  // namespace server::analysis
