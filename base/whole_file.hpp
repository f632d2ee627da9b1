// Files that a person names, read whole, and lines: never more than a bound, whatever they are.
#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <string>

namespace base {

struct WholeFile {
  std::string text;
  // In words that follow the file's name: "has more than 1048576 bytes: 2000000"; empty: it was read.
  std::string problem;
  int error = 0;  // the errno of a call that the system refused; 0: none
};

// A regular file that is too long is refused by its size, before anything is read. A pipe or a device is read, up to
// the bound.
WholeFile read_whole(const std::filesystem::path& file, std::size_t max_bytes);
WholeFile read_whole(std::istream& stream, std::size_t max_bytes);
// Up to the end of a line, which is taken and is no part of it, or to the end of all.
WholeFile read_line(std::istream& stream, std::size_t max_bytes);

}  // namespace base
