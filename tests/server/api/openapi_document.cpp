#include "tests/server/api/openapi_document.hpp"

#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace server {
namespace {

using nlohmann::json;

json scalar(const std::string& text) {
  if (text == "null" || text.empty()) return nullptr;
  if (text == "true" || text == "false") return text == "true";
  json number = json::parse(text, nullptr, false);
  return number.is_number() ? number : json(text);
}

// "{ a: 1, b: [x, 'y z'] }", "'a text'", or a plain text up to the end of the line.
class FlowReader {
 public:
  explicit FlowReader(std::string_view text) : text_{text} {}

  json read_all() {
    json value = read("");
    if (skip() != '\0') fail();
    return value;
  }

 private:
  char skip() {
    while (at_ < text_.size() && text_[at_] == ' ') ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  [[noreturn]] void fail() const { throw std::runtime_error{"no YAML of this document: " + std::string{text_}}; }

  json read(std::string_view ends) {
    const char first = skip();
    if (first == '{') return read_members();
    if (first == '[') return read_items();
    if (first == '\'') return read_quoted();
    const auto end = ends.empty() ? text_.size() : std::min(text_.find_first_of(ends, at_), text_.size());
    std::string text{text_.substr(at_, end - at_)};
    at_ = end;
    text.erase(text.find_last_not_of(' ') + 1);
    return scalar(text);
  }

  json read_quoted() {
    std::string text;
    for (++at_; at_ < text_.size(); ++at_) {
      if (text_[at_] != '\'') {
        text += text_[at_];
      } else if (text_.substr(at_, 2) == "\'\'") {
        text += text_[at_++];
      } else {
        ++at_;
        return text;
      }
    }
    fail();
  }

  json read_items() {
    json items = json::array();
    ++at_;
    while (skip() != ']') {
      items.push_back(read(",]"));
      if (skip() == ',') ++at_;
      if (skip() == '\0') fail();
    }
    ++at_;
    return items;
  }

  json read_members() {
    json members = json::object();
    ++at_;
    while (skip() != '}') {
      const json name = read(":");
      if (skip() != ':') fail();
      ++at_;
      members[name.is_string() ? name.get<std::string>() : name.dump()] = read(",}");
      if (skip() == ',') ++at_;
      if (skip() == '\0') fail();
    }
    ++at_;
    return members;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

struct Line {
  std::size_t depth;
  std::string text;
};

// Blocks by their indentation; a list and a mapping in braces may go on in lines that are indented further.
class BlockReader {
 public:
  explicit BlockReader(std::istream& in) {
    for (std::string line; std::getline(in, line);) {
      const auto depth = line.find_first_not_of(' ');
      if (depth != std::string::npos && line[depth] != '#') lines_.push_back({depth, line.substr(depth)});
    }
  }

  json read_block(std::size_t depth) {
    json block;
    while (at_ < lines_.size() && lines_[at_].depth == depth) {
      if (lines_[at_].text.starts_with("- ")) {
        lines_[at_] = {depth + 2, lines_[at_].text.substr(2)};
        const bool is_mapping = lines_[at_].text.find_first_of("{'") != 0 && colon() != std::string::npos;
        block.push_back(is_mapping ? read_block(depth + 2) : FlowReader{lines_[at_++].text}.read_all());
      } else {
        const auto end = colon();
        if (end == std::string::npos) throw std::runtime_error{"no member: " + lines_[at_].text};
        const json name = FlowReader{lines_[at_].text.substr(0, end)}.read_all();
        const std::string value = lines_[at_++].text.substr(end + 1);
        block[name.is_string() ? name.get<std::string>() : name.dump()] = read_value(value, depth);
      }
    }
    return block;
  }

 private:
  std::size_t colon() const {
    const std::string& text = lines_[at_].text;
    const auto end = text.find(": ", text.starts_with('\'') ? text.find('\'', 1) : 0);
    if (end != std::string::npos) return end;
    return text.ends_with(':') ? text.size() - 1 : std::string::npos;
  }

  json read_value(std::string text, std::size_t depth) {
    const bool is_below = at_ < lines_.size() && lines_[at_].depth > depth;
    if (text.empty() && is_below && !lines_[at_].text.starts_with('{')) return read_block(lines_[at_].depth);
    const bool is_text = text == " |" || text == " >-";
    if (is_text) text.clear();
    while (at_ < lines_.size() && lines_[at_].depth > depth) text += ' ' + lines_[at_++].text;
    return is_text ? json(text) : FlowReader{text}.read_all();
  }

  std::vector<Line> lines_;
  std::size_t at_ = 0;
};

}  // namespace

json openapi_document() {
  std::ifstream in{OPENAPI_YAML};
  return BlockReader{in}.read_block(0);
}

}  // namespace server
