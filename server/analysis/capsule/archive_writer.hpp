// Writes a zip archive piece by piece, always the same for the same contents: fixed times, no attributes.
//
//   archive = entry* directory end
//   the comment in its end: "sha256 of all before it: " and 64 hexadecimal digits                       (1)
// So each byte of the archive is covered by (1), those between the entries too. An archive that another program has
// packed anew has no such comment.
// Errors: throws std::runtime_error when the disk does not take it.
#pragma once

#include <sodium.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace server::analysis {

inline constexpr const char* kSealWords = "sha256 of all before it: ";  // of (1)
inline constexpr std::size_t kHashDigits = 64;

// Of bytes that come in pieces, in lower-case hexadecimal.
class PieceHash {
 public:
  PieceHash();
  void add(const char* bytes, std::size_t count);
  std::string text() const;

 private:
  crypto_hash_sha256_state state_;
};

struct ArchivedFile {
  std::string name;  // in the archive
  std::uint64_t bytes = 0;
  std::string sha256;
};

class ArchiveWriter {
 public:
  // The file may be there, and is replaced. Entries have this time (UTC), to 2 s.
  ArchiveWriter(std::filesystem::path path, std::int64_t time_us);
  ~ArchiveWriter();
  ArchiveWriter(const ArchiveWriter&) = delete;
  ArchiveWriter& operator=(const ArchiveWriter&) = delete;

  void begin(const std::string& name);
  void add(const std::string& piece);
  ArchivedFile end();

  // Writes the directory; then seal() reads what was written, a piece at a time, until it returns false.
  void close();
  bool seal();

 private:
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  std::int64_t time_us_;
  void* zip_ = nullptr;  // of minizip
  ArchivedFile entry_;
  PieceHash entry_hash_, archive_hash_;
  std::uint64_t sealed_bytes_ = 0;
};

}  // namespace server::analysis
