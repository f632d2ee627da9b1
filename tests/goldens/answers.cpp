// What is left out is left out here.
#include "tests/goldens/answers.hpp"

#include <fmt/format.h>

#include <regex>
#include <sstream>

namespace server {

std::string answer_text(const std::string& target, const Answered& answered) {
  std::string text = fmt::format("GET {}\n{} {}\n", target, answered.status, answered.response.content_type);
  for (const auto& [name, value] : answered.response.headers) text += fmt::format("{}: {}\n", name, value);
  return text + "\n" + answered.body + "\n";
}

std::string without_values(const std::string& metrics) {
  std::string text;
  std::istringstream lines{metrics};
  for (std::string line; std::getline(lines, line);) {
    text += (line.starts_with('#') ? line : line.substr(0, line.rfind(' '))) + "\n";
  }
  return text;
}

std::string without_port_and_sizes(const std::string& text) {
  static const std::regex kChanging{R"re(("http_address":"127\.0\.0\.1:|"(?:database|wal)_bytes":)\d+)re"};
  return std::regex_replace(text, kChanging, "$010");
}

std::string without_date(std::string mat) {
  constexpr std::size_t kHeadTextBytes = 116;
  const std::string known = "MATLAB 5.0 MAT-file";
  if (!mat.starts_with(known) || mat.size() < kHeadTextBytes) return mat;
  mat.replace(known.size(), kHeadTextBytes - known.size(), kHeadTextBytes - known.size(), ' ');
  return mat;
}

}  // namespace server
