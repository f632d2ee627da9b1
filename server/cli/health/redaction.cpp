// By hand, in passes over the text: std::regex recurses with the length of a match and could overflow the stack.
#include "server/cli/health/redaction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

namespace server::cli {
namespace {

constexpr std::size_t kShortestSecret = 6, kLongestPlainWord = 19;
constexpr std::string_view kRemoved = "[removed]";

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }
bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }
// Of base64, base64url, hexadecimal.
bool is_of_word(char c) { return is_digit(c) || is_letter(c) || std::string_view{"+/=_-"}.contains(c); }

std::string lower_case(std::string_view text) {
  std::string lower{text};
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

std::string without_secrets(std::string text, const std::vector<std::string>& secrets) {
  for (const std::string& secret : secrets) {
    for (auto at = text.find(secret); at != std::string::npos; at = text.find(secret, at + kRemoved.size())) {
      text.replace(at, secret.size(), kRemoved);
    }
  }
  return text;
}

// From "-----BEGIN" to the end of the line of "-----END", or to the end of the text.
std::string without_pem(std::string text) {
  for (auto at = text.find("-----BEGIN"); at != std::string::npos; at = text.find("-----BEGIN", at + 1)) {
    const auto end = text.find("-----END", at);
    const auto after = end == std::string::npos ? end : text.find("-----", end + 8);
    text.replace(at, after == std::string::npos ? after : after + 5 - at, kRemoved);
  }
  return text;
}

// Host, user, password and query: "https://[removed]/path".
std::string without_hosts(std::string text) {
  for (auto at = text.find("://"); at != std::string::npos; at = text.find("://", at + 1)) {
    const std::size_t begin = at + 3;
    const auto ends = [](char c) { return is_space(c) || std::string_view{"/\"'<>,;)"}.contains(c); };
    const auto end = std::find_if(text.begin() + static_cast<std::ptrdiff_t>(begin), text.end(), ends);
    const auto length = static_cast<std::size_t>(end - text.begin()) - begin;
    text.replace(begin, length, kRemoved);
    const auto ends_query = [](char c) { return is_space(c) || std::string_view{"\"'<>"}.contains(c); };
    const auto path_end =
        std::find_if(text.begin() + static_cast<std::ptrdiff_t>(begin + kRemoved.size()), text.end(), ends_query);
    const auto query = std::find(text.begin() + static_cast<std::ptrdiff_t>(begin), path_end, '?');
    text.erase(query, path_end);
  }
  return text;
}

// "password = hunter2", "Authorization: Bearer abc", "code=abc": the word after such a name.
std::string without_named_values(std::string text) {
  constexpr std::array<std::string_view, 14> kNames{"token",  "password", "passwd",   "secret",  "bearer",
                                                    "cookie", "code=",    "apikey",   "api-key", "authorization",
                                                    "psk",    "pwd",      "wifi key", "ticket="};
  const std::string lower = lower_case(text);
  std::vector<std::pair<std::size_t, std::size_t>> found;  // begin and end of each value
  for (const std::string_view name : kNames) {
    for (auto at = lower.find(name); at != std::string::npos; at = lower.find(name, at + 1)) {
      std::size_t begin = at + name.size();
      const bool is_whole = name.ends_with('=');
      while (!is_whole && begin < text.size() &&
             (is_letter(text[begin]) || std::string_view{"_-"}.contains(text[begin])))
        ++begin;  // "tokens", "token_hash"
      while (begin < text.size() && std::string_view{" \t\"'=:\\"}.contains(text[begin])) ++begin;
      std::size_t end = begin;
      // These have several words: all of the line goes.
      const bool is_header = name == "cookie" || name == "authorization";
      if (is_header) end = std::min(text.find('\n', begin), text.size());
      while (end < text.size() && !is_header && !is_space(text[end]) &&
             !std::string_view{"\"',;&|)}<>"}.contains(text[end]))
        ++end;
      const bool names_scheme = lower.compare(begin, end - begin, "bearer") == 0;
      if (end > begin && !names_scheme) found.emplace_back(begin, end);
    }
  }
  std::ranges::sort(found);
  std::string out;
  std::size_t copied = 0;
  for (const auto& [begin, end] : found) {
    if (begin < copied) continue;
    out.append(text, copied, begin - copied).append(kRemoved);
    copied = end;
  }
  return out.append(text, copied);
}

// A name of a parameter or a figure: acceleration_bias_m_s2.
bool is_plain_name(std::string_view word) {
  constexpr std::ptrdiff_t kMostDigits = 3;
  const bool is_snake =
      std::ranges::all_of(word, [](char c) { return (c >= 'a' && c <= 'z') || is_digit(c) || c == '_'; });
  return is_snake && word.contains('_') && std::ranges::count_if(word, is_digit) <= kMostDigits;
}

std::string without_long_words(std::string_view text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const auto end = static_cast<std::size_t>(
        std::find_if_not(text.begin() + static_cast<std::ptrdiff_t>(at), text.end(), is_of_word) - text.begin());
    const std::string_view word = text.substr(at, end - at);
    const bool is_mixed = std::ranges::any_of(word, is_digit) && std::ranges::any_of(word, is_letter);
    if (word.size() > kLongestPlainWord && is_mixed && !is_plain_name(word)) {
      out += fmt::format("[removed: {} characters]", word.size());
    } else {
      out += word;
    }
    if (end < text.size()) out += text[end];
    at = end + 1;
  }
  return out;
}

}  // namespace

void Redaction::add_secret(std::string secret) {
  if (secret.size() >= kShortestSecret) secrets_.push_back(std::move(secret));
}

std::string Redaction::of(std::string_view text) const {
  return of_own(without_named_values(without_pem(std::string{text})));
}

std::string Redaction::of_own(std::string_view text) const {
  return without_long_words(without_hosts(without_pem(without_secrets(std::string{text}, secrets_))));
}

}  // namespace server::cli
