// Reads, compares and writes; a difference is shown by line for text and by offset for bytes.
#include "tests/goldens/golden_file.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace server {
namespace {

constexpr std::size_t kShownBytes = 120;  // of each side of a difference
constexpr std::size_t kShownBefore = 40;

std::string read_file(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream{path, std::ios::binary}.rdbuf();
  return text.str();
}

// Text to the end of its line; of other bytes all but ASCII in hexadecimal.
std::string quoted(const std::string& text, std::size_t from) {
  const bool is_text = text.find('\0') == std::string::npos;
  std::string shown;
  for (const char c : text.substr(std::min(from, text.size()), kShownBytes)) {
    const auto byte = static_cast<unsigned char>(c);
    if (is_text && c == '\n') break;
    const bool is_plain = byte >= 0x20 && (byte < 0x7f || (is_text && byte > 0x7f));
    shown += is_plain ? std::string{c} : fmt::format("\\x{:02x}", byte);
  }
  return from >= text.size() ? "(the end)" : shown;
}

std::string difference(const std::string& then, const std::string& now) {
  const auto [in_then, in_now] = std::ranges::mismatch(then, now);
  const auto at = static_cast<std::size_t>(in_then - then.begin());
  const auto line = 1 + std::count(then.begin(), in_then, '\n');
  const std::size_t line_begin = at == 0 ? 0 : then.rfind('\n', at - 1) + 1;  // npos + 1 is 0
  const std::size_t from = std::max(line_begin, at < kShownBefore ? 0 : at - kShownBefore);
  return fmt::format("line {}, offset {} (of {} bytes, now {}):\n  golden: {}\n  now:    {}", line, at, then.size(),
                     now.size(), quoted(then, from), quoted(now, from));
}

}  // namespace

std::filesystem::path golden_path(const std::string& name) {
  return std::filesystem::path{TEST_DATA_DIR} / "goldens" / name;
}

void expect_golden(const std::string& name, const std::string& now) {
  const std::filesystem::path path = golden_path(name);
  if (std::getenv("RHEONAUT_RENEW_GOLDENS") != nullptr) {
    std::filesystem::create_directories(path.parent_path());
    std::ofstream{path, std::ios::binary} << now;
    return;
  }
  ASSERT_TRUE(std::filesystem::exists(path)) << "no golden " << name << ": CONTRIBUTING.md says how to renew them";
  const std::string then = read_file(path);
  if (then != now) ADD_FAILURE() << "tests/data/goldens/" << name << " differs in " << difference(then, now);
}

}  // namespace server
