// Block by block, so that no more is read than is allowed.
#include "base/whole_file.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace base {
namespace fs = std::filesystem;

namespace {

WholeFile too_long(std::size_t max_bytes, const std::string& size = {}) {
  return {.text = {}, .problem = "has more than " + std::to_string(max_bytes) + " bytes" + size};
}

WholeFile refused(int error) {
  return {.text = {}, .problem = std::string{"cannot be read: "} + std::strerror(error), .error = error};
}

}  // namespace

WholeFile read_whole(std::istream& stream, std::size_t max_bytes) {
  WholeFile whole;
  errno = 0;
  for (std::array<char, 65536> block{}; stream.read(block.data(), block.size()) || stream.gcount() > 0;) {
    whole.text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (whole.text.size() > max_bytes) return too_long(max_bytes);
  }
  return stream.bad() ? refused(errno) : whole;
}

WholeFile read_whole(const fs::path& file, std::size_t max_bytes) {
  std::error_code unknown;
  const fs::file_type type = fs::status(file, unknown).type();
  if (type == fs::file_type::directory) return {.text = {}, .problem = "is a folder; give a file"};
  if (type == fs::file_type::regular) {
    const std::uintmax_t bytes = fs::file_size(file, unknown);
    if (!unknown && bytes > max_bytes) return too_long(max_bytes, ": " + std::to_string(bytes));
  }
  errno = 0;
  std::ifstream stream{file, std::ios::binary};
  return stream ? read_whole(stream, max_bytes) : refused(errno);
}

WholeFile read_line(std::istream& stream, std::size_t max_bytes) {
  WholeFile line;
  errno = 0;
  bool is_there = false;
  for (char one = 0; stream.get(one); line.text += one) {
    is_there = true;
    if (one == '\n') break;
    if (line.text.size() == max_bytes) return too_long(max_bytes);
  }
  if (stream.bad()) return refused(errno);
  if (!is_there) line.problem = "has no line";
  if (line.text.ends_with('\r')) line.text.pop_back();
  return line;
}

}  // namespace base
