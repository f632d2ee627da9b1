// Walks over the text, past its strings.
#include "base/nesting.hpp"

#include <cstddef>
#include <vector>

namespace base {
namespace {

// The place after a string that begins here; of TOML: basic or literal, of one line or of several.
std::size_t after_toml_string(std::string_view text, std::size_t at) {
  const char quote = text[at];
  const std::string_view three = quote == '"' ? R"(""")" : "'''";
  const bool is_long = text.substr(at).starts_with(three);
  for (at += is_long ? 3 : 1; at < text.size(); ++at) {
    if (quote == '"' && text[at] == '\\') {
      ++at;
    } else if (is_long && text.substr(at).starts_with(three)) {
      at += 3;  // one or two more are of the string: it ends with the last three
      for (int more = 0; more < 2 && at < text.size() && text[at] == quote; ++more) ++at;
      return at;
    } else if (!is_long && (text[at] == quote || text[at] == '\n')) {
      return at + 1;
    }
  }
  return text.size();
}

}  // namespace

bool is_json_deeper(std::string_view text, int most) {
  int depth = 0;
  bool in_text = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '"') in_text = !in_text;
    if (in_text && c == '\\') ++at;
    if (in_text) continue;
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (depth > most) return true;
  }
  return false;
}

bool is_toml_deeper(std::string_view text, int most) {
  std::vector<int> open;  // what each open bracket added: itself, and the dots of the key before it
  int depth = 0, dots = 0, header = 0;
  bool is_line_begin = true, is_header = false;
  const auto close = [&] {
    if (open.empty()) return;
    depth -= open.back();
    open.pop_back();
  };
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '"' || c == '\'') {
      at = after_toml_string(text, at);
      is_line_begin = false;
      continue;
    }
    if (c == '#') {
      while (at < text.size() && text[at] != '\n') ++at;
      continue;
    }
    ++at;
    if (c == '\n') {
      is_line_begin = true;
      if (open.empty()) dots = 0;
      is_header = false;
    } else if (c == '.') {
      ++dots;
    } else if (c == '[' && open.empty() && is_line_begin) {
      is_header = true;
      header = dots = 0;
    } else if ((c == '[' || c == ']') && is_header) {
      header = dots + 2;
    } else if (c == '[' || c == '{') {
      open.push_back(dots + 1);
      depth += open.back();
      dots = 0;
    } else if (c == ']' || c == '}') {
      close();
      dots = 0;
    } else if (c == ',') {
      dots = 0;
    }
    if (c != ' ' && c != '\t' && c != '\r' && c != '\n') is_line_begin = false;
    if (header + depth + dots + 1 > most) return true;
  }
  return false;
}

}  // namespace base
