// A column of a MAT file whose length is known only at its end: it grows in a file of its own, which nobody else sees,
// and is appended to the MAT file when it is whole.
//
// MAT 5 is a header and then elements one after another, so a variable can be appended to a file that matio wrote:
//
//   element    := tag(miMATRIX, size of the rest) flags dimensions name values
//   flags      := tag(miUINT32, 8) class 0         dimensions := tag(miINT32, 8) rows 1
//   name       := tag(miINT8, length) text pad     values     := tag(type, size) numbers pad
//   tag        := type size (32 bits each, little-endian); pad: zeros to a multiple of 8
//
// "MAT-File Format", The MathWorks, version 5. Blocks; throws std::system_error when the disk does not take it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace server::storage {

class MatColumn {
 public:
  enum class Type : std::uint8_t { float64, float32, uint32 };

  // `folder` holds the file while it grows.
  MatColumn(std::string name, Type type, const std::filesystem::path& folder);
  ~MatColumn();
  MatColumn(MatColumn&& other) noexcept;
  MatColumn& operator=(MatColumn&&) = delete;

  void push(double value) { append(&value, sizeof value); }
  void push(float value) { append(&value, sizeof value); }
  void push(std::uint32_t value) { append(&value, sizeof value); }

  const std::string& name() const { return name_; }
  std::uint64_t size_bytes() const { return size_bytes_; }

  // Appends the next piece of the element to the file; false when it is there as a whole. Nothing is pushed any more.
  bool copy_some(int file);

 private:
  void append(const void* bytes, std::size_t size);
  void flush();
  std::string element_beginning() const;

  std::string name_;
  Type type_;
  int file_ = -1;
  std::string buffer_;  // not written yet
  std::uint64_t size_bytes_ = 0;
  std::uint64_t copied_bytes_ = 0;
  bool begun_ = false;
};

// Writes everything or throws.
void write_all(int file, const void* bytes, std::size_t size);

}  // namespace server::storage
