#include "server/http/target.hpp"

#include <utility>

namespace server {
namespace {

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// Empty when the path is not acceptable.
std::vector<std::string> path_segments(std::string_view target) {
  const std::string_view path = target.substr(0, target.find('?'));
  if (path.empty() || path.front() != '/') return {};
  auto segments = split(path.substr(1), '/');
  for (std::string& segment : segments) {
    auto decoded = percent_decode(segment, false);
    if (!decoded || *decoded == ".." || *decoded == "." || decoded->find_first_of("/\\") != std::string::npos) {
      return {};
    }
    segment = std::move(*decoded);
  }
  return segments;
}

}  // namespace

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  for (;;) {
    const auto end = text.find(separator);
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

std::optional<std::string> percent_decode(std::string_view text, bool plus_is_space) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '+' && plus_is_space) {
      c = ' ';
    } else if (c == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const int high = hex_value(text[i + 1]);
      const int low = hex_value(text[i + 2]);
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return std::nullopt;
    out += c;
  }
  return out;
}

Target::Target(std::string text) : text_{std::move(text)}, segments_{path_segments(text_)} {
  for (const std::string& segment : segments_) path_ += "/" + segment;
}

std::string_view Target::query() const {
  const auto question_mark = text_.find('?');
  return question_mark == std::string::npos ? std::string_view{} : std::string_view{text_}.substr(question_mark + 1);
}

}  // namespace server
