#include "server/http/target.hpp"

#include <algorithm>
#include <cctype>
#include <tuple>
#include <utility>

namespace server::http {
namespace {

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// Empty when the path is not acceptable.
std::vector<std::string> path_segments(std::string_view path) {
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

// The authority, and what is behind it; none when the text does not begin with a scheme of HTTP.
std::optional<std::pair<std::string, std::string>> absolute_form(const std::string& text) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    const auto same = [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; };
    if (!std::ranges::equal(text.substr(0, scheme.size()), scheme, same)) continue;
    const auto end = std::min(text.find_first_of("/?", scheme.size()), text.size());
    std::string behind = text.substr(end);
    if (!behind.starts_with('/')) behind.insert(behind.begin(), '/');
    return std::pair{text.substr(scheme.size(), end - scheme.size()), std::move(behind)};
  }
  return std::nullopt;
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

Target::Target(std::string text) : text_{std::move(text)} {
  if (auto absolute = absolute_form(text_)) std::tie(authority_, text_) = std::move(*absolute);
  path_size_ = std::min(text_.find('?'), text_.size());
  if (authority_.find('@') == std::string::npos)  // what looks like the host may be a user's name there
    segments_ = path_segments(std::string_view{text_}.substr(0, path_size_));
  for (const std::string& segment : segments_) path_ += "/" + segment;
}

std::optional<Target::Query> Target::query() const {
  Query query;
  if (path_size_ + 1 >= text_.size()) return query;
  for (const std::string& pair : split(std::string_view{text_}.substr(path_size_ + 1), '&')) {
    const auto equals = pair.find('=');
    auto name = percent_decode(pair.substr(0, equals), true);
    auto value = percent_decode(equals == std::string::npos ? "" : pair.substr(equals + 1), true);
    if (!name || !value) return std::nullopt;
    query.emplace_back(std::move(*name), std::move(*value));
  }
  return query;
}

}  // namespace server::http
