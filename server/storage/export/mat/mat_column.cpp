// The bytes of a miMATRIX element.
#include "server/storage/export/mat/mat_column.hpp"

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

namespace server::storage {
namespace {

constexpr std::size_t kBufferBytes = 64 * 1024;
constexpr std::size_t kCopyBytes = 4 * 1024 * 1024;

// By Type.
constexpr std::uint32_t kElementTypes[] = {9, 7, 6};  // miDOUBLE, miSINGLE, miUINT32
constexpr std::uint32_t kClasses[] = {6, 7, 13};      // mxDOUBLE_CLASS, mxSINGLE_CLASS, mxUINT32_CLASS
constexpr std::uint64_t kValueBytes[] = {8, 4, 4};
constexpr std::uint32_t kInt8 = 1, kInt32 = 5, kUint32 = 6, kMatrix = 14;

[[noreturn]] void fail_with(const std::string& what) { throw std::system_error{errno, std::generic_category(), what}; }

void append_words(std::string& out, std::initializer_list<std::uint64_t> words) {
  for (const std::uint64_t word : words) {
    for (unsigned shift = 0; shift < 32; shift += 8) out += static_cast<char>(word >> shift & 0xff);
  }
}

std::uint64_t padded(std::uint64_t size) { return (size + 7) / 8 * 8; }

int unlinked_file(const std::filesystem::path& folder) {
  std::string name = (folder / "column-XXXXXX").string();
  const int file = ::mkostemp(name.data(), O_CLOEXEC);
  if (file < 0) fail_with("cannot create a file in " + folder.string());
  ::unlink(name.c_str());
  return file;
}

}  // namespace

void write_all(int file, const void* bytes, std::size_t size) {
  const char* next = static_cast<const char*>(bytes);
  while (size > 0) {
    const ssize_t written = ::write(file, next, size);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail_with("cannot write an export");
    next += written;
    size -= static_cast<std::size_t>(written);
  }
}

MatColumn::MatColumn(std::string name, Type type, const std::filesystem::path& folder)
    : name_{std::move(name)}, type_{type}, file_{unlinked_file(folder)} {}

MatColumn::~MatColumn() {
  if (file_ >= 0) ::close(file_);
}

MatColumn::MatColumn(MatColumn&& other) noexcept
    : name_{std::move(other.name_)},
      type_{other.type_},
      file_{std::exchange(other.file_, -1)},
      buffer_{std::move(other.buffer_)},
      size_bytes_{other.size_bytes_},
      copied_bytes_{other.copied_bytes_},
      begun_{other.begun_} {}

void MatColumn::append(const void* bytes, std::size_t size) {
  buffer_.append(static_cast<const char*>(bytes), size);
  size_bytes_ += size;
  if (buffer_.size() >= kBufferBytes) flush();
}

void MatColumn::flush() {
  write_all(file_, buffer_.data(), buffer_.size());
  buffer_.clear();
}

std::string MatColumn::element_beginning() const {
  const auto type = static_cast<std::size_t>(type_);
  const std::uint64_t rows = size_bytes_ / kValueBytes[type];
  std::string rest;
  append_words(rest, {kUint32, 8, kClasses[type], 0});
  append_words(rest, {kInt32, 8, rows, 1});
  append_words(rest, {kInt8, name_.size()});
  rest += name_;
  rest.resize(padded(rest.size()), '\0');
  append_words(rest, {kElementTypes[type], size_bytes_});
  std::string element;
  append_words(element, {kMatrix, rest.size() + padded(size_bytes_)});
  return element + rest;
}

bool MatColumn::copy_some(int file) {
  if (!begun_) {
    flush();
    const std::string beginning = element_beginning();
    write_all(file, beginning.data(), beginning.size());
    begun_ = true;
  }
  std::string piece(std::min<std::uint64_t>(kCopyBytes, size_bytes_ - copied_bytes_), '\0');
  const ssize_t size = ::pread(file_, piece.data(), piece.size(), static_cast<off_t>(copied_bytes_));
  if (size < 0) fail_with("cannot read an export");
  write_all(file, piece.data(), static_cast<std::size_t>(size));
  copied_bytes_ += static_cast<std::uint64_t>(size);
  if (copied_bytes_ < size_bytes_) return true;
  const std::string pad(padded(size_bytes_) - size_bytes_, '\0');
  write_all(file, pad.data(), pad.size());
  return false;
}

}  // namespace server::storage
