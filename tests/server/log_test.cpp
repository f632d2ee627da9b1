// Both formats of the log: one entry is one line, whatever is in it.
#include "server/runtime/log.hpp"

#include <gmock/gmock.h>
#include <spdlog/details/log_msg.h>
#include <spdlog/formatter.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <regex>

namespace server {
namespace {

std::string line_of(const std::string& format, const std::string& message) {
  const auto formatter = runtime::log_formatter(format);
  const auto time = spdlog::log_clock::time_point{std::chrono::microseconds{1'795'242'654'000'042}};
  const spdlog::details::log_msg entry{time, {}, "rheonaut", spdlog::level::warn, message};
  spdlog::memory_buf_t out;
  formatter->format(entry, out);
  return {out.data(), out.size()};
}

// What robots and clients may call themselves or send, before anything is checked.
const std::vector<std::string> kHostile{
    "robot 'r1\n2026-11-26 13:00:00.000  info     audit: goes on from 1:00'",
    "\r\n{\"level\":\"critical\",\"message\":\"forged\"}",
    "quote \" backslash \\ brace }",
    std::string{"nul \0 inside", 12},
    "\x1b[2J\x1b]0;title\x07",
    "delete \x7f, C1 \xc2\x9b"
    "31m",
    "broken UTF-8 \xff\xfe \xc2",
    "line \xe2\x80\xa8 separator, umlaut \xc3\xa4",
};

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

TEST(Log, OneEntryIsOneLineInEitherFormat) {
  for (const char* format : {"text", "json"}) {
    for (const std::string& message : kHostile) {
      std::string line = line_of(format, message);
      ASSERT_TRUE(line.ends_with('\n')) << line;
      line.pop_back();
      EXPECT_TRUE(std::ranges::none_of(line, is_control)) << format << ": " << line;
      EXPECT_THAT(line, ::testing::Not(::testing::HasSubstr("\xc2\x9b"))) << format;
    }
  }
}

TEST(Log, JsonHasTimeLevelAndTheMessageAsItWas) {
  const nlohmann::json entry = nlohmann::json::parse(line_of("json", "robot 'r1\n' says \"\xc3\xa4\""));
  EXPECT_EQ(entry["time"], "2026-11-21T06:30:54.000042Z");
  EXPECT_EQ(entry["level"], "warning");
  EXPECT_EQ(entry["message"], "robot 'r1\n' says \"\xc3\xa4\"");
  EXPECT_TRUE(entry["thread"].is_number_unsigned());
  for (const std::string& message : kHostile) {
    const nlohmann::json parsed = nlohmann::json::parse(line_of("json", message));
    EXPECT_EQ(parsed["level"], "warning") << message;
    EXPECT_EQ(parsed.size(), 4U) << message;
  }
}

TEST(Log, TextShowsWhatWasEscaped) {
  EXPECT_THAT(line_of("text", "a\nb\x1b[1m"), ::testing::EndsWith("  a\\nb\\x1b[1m\n"));
  EXPECT_TRUE(
      std::regex_search(line_of("text", "a"), std::regex{R"(^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} [+-]\d\d:\d\d  )"}))
      << "its zone is named";
  EXPECT_THAT(line_of("text", "C:\\data \xc3\xa4"), ::testing::EndsWith("  C:\\data \xc3\xa4\n"));
}

}  // namespace
}  // namespace server
