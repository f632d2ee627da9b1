// How deep a text in JSON or TOML is nested, found before it is parsed: what reads, copies or destroys a value calls
// itself once a level, so that the depth of a text is the depth of the stack. Both are linear in the text and call
// nothing.
#pragma once

#include <string_view>

namespace base {

inline constexpr int kMostJsonDepth = 64, kMostTomlDepth = 32;  // of documents; what is sent to the station has less

// Open lists and objects, outside of texts; true as soon as there are more than `most`.
bool is_json_deeper(std::string_view text, int most);

// Tables of a header, of a dotted key ("a.b.c" are three) and of values, all that are in each other.
bool is_toml_deeper(std::string_view text, int most);

}  // namespace base
