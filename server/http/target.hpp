// The target of a request: its text, and its path and query, which are parsed here alone.
//
// The absolute form, "http://station:8080/api", is taken as the path and query behind its authority; what authority()
// names then stands in the place of the Host header (RFC 9112, section 3.2.2). Checks of the path use path() or
// segments(), never the text.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace server::http {

class Target {
 public:
  Target() = default;
  Target(std::string text);  // NOLINT(google-explicit-constructor): a target is written as its text
  Target(const char* text) : Target{std::string{text}} {}  // NOLINT(google-explicit-constructor)

  const std::string& text() const { return text_; }            // from its path on
  const std::string& authority() const { return authority_; }  // empty when it is not in the absolute form
  bool is_acceptable() const { return !segments_.empty(); }
  // The segments of the path, split and then decoded; at least one. None, and an empty path, when it is not acceptable.
  const std::vector<std::string>& segments() const { return segments_; }
  const std::string& path() const { return path_; }
  // Names and values, decoded, in their order; empty when it is not a valid encoding.
  using Query = std::vector<std::pair<std::string, std::string>>;
  std::optional<Query> query() const;

 private:
  std::string authority_;
  std::string text_;
  std::size_t path_size_ = 0;  // of the text: what follows is the query with its question mark
  std::vector<std::string> segments_;
  std::string path_;
};

std::vector<std::string> split(std::string_view text, char separator);

// "%41" to "A"; empty when the text is not a valid encoding, or decodes to a control character.
std::optional<std::string> percent_decode(std::string_view text, bool plus_is_space);

}  // namespace server::http
