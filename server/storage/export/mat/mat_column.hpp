// A column of a MAT file whose length is known only at its end: it grows in a file of its own, which nobody else sees,
// and is appended to the MAT file when it is whole.
//
// MAT 5 is a header and then elements one after another, so a variable can be appended to a file that matio wrote:
//
//   element    := tag(miMATRIX, size of the rest) flags dimensions name values
//   flags      := tag(miUINT32, 8) class 0         dimensions := tag(miINT32, 8) rows columns
//   name       := tag(miINT8, length) text pad     values     := tag(type, size) numbers pad
//   tag        := type size (32 bits each, little-endian); pad: zeros to a multiple of 8
//
// Columns is 1, but of texts: these are a matrix of characters, as wide as the longest word, filled with blanks. A
// matrix is written column by column, so the column keeps the numbers of its words and becomes characters when it is
// copied.
//
// "MAT-File Format", The MathWorks, version 5. Blocks; throws std::system_error when the disk does not take it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace server::storage {

class MatColumn {
 public:
  enum class Type : std::uint8_t { float64, float32, uint32, uint64, text };
  static constexpr std::uint32_t kNoWord = 0xffffffff;  // in a column of texts: blanks

  // `folder` holds the file while it grows. Of a column of texts `words` are what can be in it, in ASCII: it is given
  // their numbers, and the last one stands for every number that is not there.
  MatColumn(std::string name, Type type, const std::filesystem::path& folder, std::vector<std::string> words = {});
  ~MatColumn();
  MatColumn(MatColumn&& other) noexcept;
  MatColumn& operator=(MatColumn&&) = delete;

  void push(double value) { append(&value, sizeof value); }
  void push(float value) { append(&value, sizeof value); }
  void push(std::uint32_t value) { append(&value, sizeof value); }
  void push(std::uint64_t value) { append(&value, sizeof value); }

  const std::string& name() const { return name_; }
  std::uint64_t size_bytes() const { return rows() * width() * value_bytes(); }  // of its values in the MAT file

  // Appends the next piece of the element to the file; false when it is there as a whole. Nothing is pushed any more.
  bool copy_some(int file);

 private:
  void append(const void* bytes, std::size_t size);
  void flush();
  std::uint64_t rows() const;
  std::uint64_t width() const;
  std::uint64_t value_bytes() const;
  std::string element_beginning() const;
  std::string next_values() const;
  std::string characters(std::uint64_t place, std::uint64_t first_row) const;
  std::string read(std::uint64_t from, std::uint64_t size) const;

  std::string name_;
  Type type_;
  std::vector<std::string> words_;
  int file_ = -1;
  std::string buffer_;  // not written yet
  std::uint64_t pushed_bytes_ = 0;
  std::uint64_t copied_bytes_ = 0;
  bool begun_ = false;
};

// Writes everything or throws.
void write_all(int file, const void* bytes, std::size_t size);

}  // namespace server::storage
