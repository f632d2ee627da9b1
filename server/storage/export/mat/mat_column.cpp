// The bytes of a miMATRIX element.
#include "server/storage/export/mat/mat_column.hpp"

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

namespace server::storage {
namespace {

constexpr std::size_t kBufferBytes = 64 * 1024;
constexpr std::size_t kCopyBytes = 4 * 1024 * 1024;

// By Type.
constexpr std::uint32_t kElementTypes[] = {9, 7, 6, 13, 16};  // miDOUBLE, miSINGLE, miUINT32, miUINT64, miUTF8
constexpr std::uint32_t kClasses[] = {6, 7, 13, 15, 4};       // mxDOUBLE_CLASS, …_SINGLE, …_UINT32, …_UINT64, …_CHAR
constexpr std::uint64_t kValueBytes[] = {8, 4, 4, 8, 1};      // in the MAT file
constexpr std::uint64_t kPushedBytes[] = {8, 4, 4, 8, sizeof(std::uint32_t)};
constexpr std::uint32_t kInt8 = 1, kInt32 = 5, kUint32 = 6, kMatrix = 14;

[[noreturn]] void fail_with(const std::string& what) { throw std::system_error{errno, std::generic_category(), what}; }

void append_words(std::string& out, std::initializer_list<std::uint64_t> words) {
  for (const std::uint64_t word : words) {
    for (unsigned shift = 0; shift < 32; shift += 8) out += static_cast<char>(word >> shift & 0xff);
  }
}

std::uint64_t padded(std::uint64_t size) { return (size + 7) / 8 * 8; }

// Without a name from its beginning, so that a program that is killed leaves nothing; where the file system knows no
// such file, it has a name for a moment.
int unlinked_file(const std::filesystem::path& folder) {
  const int nameless = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_EXCL | O_CLOEXEC, 0600);
  if (nameless >= 0) return nameless;
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

MatColumn::MatColumn(std::string name, Type type, const std::filesystem::path& folder, std::vector<std::string> words)
    : name_{std::move(name)}, type_{type}, words_{std::move(words)}, file_{unlinked_file(folder)} {}

MatColumn::~MatColumn() {
  if (file_ >= 0) ::close(file_);
}

MatColumn::MatColumn(MatColumn&& other) noexcept
    : name_{std::move(other.name_)},
      type_{other.type_},
      words_{std::move(other.words_)},
      file_{std::exchange(other.file_, -1)},
      buffer_{std::move(other.buffer_)},
      pushed_bytes_{other.pushed_bytes_},
      copied_bytes_{other.copied_bytes_},
      begun_{other.begun_} {}

void MatColumn::append(const void* bytes, std::size_t size) {
  buffer_.append(static_cast<const char*>(bytes), size);
  pushed_bytes_ += size;
  if (buffer_.size() >= kBufferBytes) flush();
}

void MatColumn::flush() {
  write_all(file_, buffer_.data(), buffer_.size());
  buffer_.clear();
}

std::uint64_t MatColumn::rows() const { return pushed_bytes_ / kPushedBytes[static_cast<std::size_t>(type_)]; }

std::uint64_t MatColumn::value_bytes() const { return kValueBytes[static_cast<std::size_t>(type_)]; }

std::uint64_t MatColumn::width() const {
  if (type_ != Type::text) return 1;
  std::size_t longest = 0;
  for (const std::string& word : words_) longest = std::max(longest, word.size());
  return longest;
}

std::string MatColumn::element_beginning() const {
  const auto type = static_cast<std::size_t>(type_);
  std::string rest;
  append_words(rest, {kUint32, 8, kClasses[type], 0});
  append_words(rest, {kInt32, 8, rows(), width()});
  append_words(rest, {kInt8, name_.size()});
  rest += name_;
  rest.resize(padded(rest.size()), '\0');
  append_words(rest, {kElementTypes[type], size_bytes()});
  std::string element;
  append_words(element, {kMatrix, rest.size() + padded(size_bytes())});
  return element + rest;
}

std::string MatColumn::read(std::uint64_t from, std::uint64_t size) const {
  std::string bytes(std::min<std::uint64_t>(kCopyBytes, size), '\0');
  const ssize_t done = ::pread(file_, bytes.data(), bytes.size(), static_cast<off_t>(from));
  if (done < 0) fail_with("cannot read an export");
  bytes.resize(static_cast<std::size_t>(done));
  return bytes;
}

// Of the matrix' column `place`, from that row on.
std::string MatColumn::characters(std::uint64_t place, std::uint64_t first_row) const {
  const std::string numbers = read(first_row * sizeof(std::uint32_t), (rows() - first_row) * sizeof(std::uint32_t));
  std::string out;
  for (std::size_t offset = 0; offset + sizeof(std::uint32_t) <= numbers.size(); offset += sizeof(std::uint32_t)) {
    std::uint32_t number = 0;
    std::memcpy(&number, &numbers[offset], sizeof number);
    const std::string& word = words_[std::min<std::size_t>(number, words_.size() - 1)];
    out += number != kNoWord && place < word.size() ? word[place] : ' ';
  }
  return out;
}

// Those after what is copied; not empty before the end.
std::string MatColumn::next_values() const {
  if (copied_bytes_ == size_bytes()) return {};
  if (type_ == Type::text) return characters(copied_bytes_ / rows(), copied_bytes_ % rows());
  return read(copied_bytes_, size_bytes() - copied_bytes_);
}

bool MatColumn::copy_some(int file) {
  if (!begun_) {
    flush();
    const std::string beginning = element_beginning();
    write_all(file, beginning.data(), beginning.size());
    begun_ = true;
  }
  const std::string values = next_values();
  write_all(file, values.data(), values.size());
  copied_bytes_ += values.size();
  if (copied_bytes_ < size_bytes()) return true;
  const std::string pad(padded(size_bytes()) - size_bytes(), '\0');
  write_all(file, pad.data(), pad.size());
  return false;
}

}  // namespace server::storage
