// fsync, rename, fsync; and what rename cannot do between two disks.
#include "server/storage/database/finished_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>

namespace server::storage {
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kPieceBytes = 1024 * 1024;

void sync(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool synced = file >= 0 && ::fsync(file) == 0;
  const int error = errno;
  if (file >= 0) ::close(file);
  if (!synced) throw std::system_error{error, std::generic_category(), "cannot sync " + path.string()};
}

// What is read of a synced file after this comes from its disk.
void forget_cached(const fs::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return;  // reading it will report the error
  ::posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED);
  ::close(file);
}

std::string read_piece(std::ifstream& file) {
  std::string piece(kPieceBytes, '\0');
  file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
  piece.resize(static_cast<std::size_t>(file.gcount()));
  return piece;
}

}  // namespace

void sync_folder_of(const fs::path& path) { sync(fs::absolute(path).parent_path()); }

bool holds_the_same(const fs::path& file, const fs::path& copy) {
  forget_cached(copy);
  std::ifstream written{file, std::ios::binary};
  std::ifstream read{copy, std::ios::binary};
  if (!written || !read) return false;
  for (;;) {
    const std::string piece = read_piece(written);
    if (piece != read_piece(read) || written.bad() || read.bad()) return false;
    if (piece.empty()) return true;
  }
}

void copy_finished(const fs::path& from, const fs::path& to) {
  const Draft draft{fs::path{to}.concat(".part")};
  fs::copy_file(from, draft.path());
  sync(draft.path());
  if (!holds_the_same(from, draft.path())) {
    throw std::runtime_error{
        fmt::format("'{}' does not hold what was written; '{}' is whole", to.string(), from.string())};
  }
  finish_file(draft.path(), to);
}

void move_finished(const fs::path& from, const fs::path& to) {
  std::error_code other_disk;
  fs::rename(from, to, other_disk);
  if (other_disk) {
    copy_finished(from, to);
    fs::remove(from);
  } else {
    sync_folder_of(to);
  }
  sync_folder_of(from);
}

void finish_file(const std::filesystem::path& part, const std::filesystem::path& path) {
  sync(part);
  std::filesystem::rename(part, path);
  sync_folder_of(path);
}

void remove_draft(const std::filesystem::path& part) {
  std::error_code ignored;
  for (const char* suffix : kDraftSuffixes) {
    std::filesystem::remove(std::filesystem::path{part}.concat(suffix), ignored);
  }
}

}  // namespace server::storage
