// One file that cmake/embed_files.py put into the program: its name, its bytes and their digest.
//
// The bytes are read-only data of the program: they live as long as it runs, and any thread may read them. A zero byte
// follows them, so that content.data() is a C string where the file holds none.
#pragma once

#include <string_view>

namespace base {

struct EmbeddedFile {
  std::string_view name;
  std::string_view content;
  std::string_view digest;  // the first 32 hexadecimal digits of its SHA-256
};

}  // namespace base
