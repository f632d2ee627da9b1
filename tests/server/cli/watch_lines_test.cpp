// The table of `rheonaut watch`: what is marked as old, and what a name may not do to the terminal.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "server/cli/robots/watch.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr std::int64_t kNowUs = 1'750'000'000'000'000;

json robot(std::int64_t age_us, const char* link = "connected") {
  return {{"robot_id", "sim-1"},     {"link", link},
          {"mode", "auto"},          {"sample", {{"position_m", 0.0981}, {"duty", 0.25}}},
          {"position_sd_m", 0.0011}, {"last_received_at_us", kNowUs - age_us},
          {"emergency_id", nullptr}, {"emergency_cause", nullptr},
          {"pending_stop", nullptr}, {"control", nullptr}};
}

std::string line_of(const json& one, bool with_colours = false) {
  return watch_lines(json::array({one}), kNowUs, 100, with_colours).at(1);
}

TEST(WatchLines, ShowThePositionWithItsStandardDeviation) {
  EXPECT_THAT(line_of(robot(40'000)), ::testing::ContainsRegex("^sim-1 +auto +98.1 ± 1.1 +25 % +0.0 s"));
  json unknown = robot(40'000);
  unknown["position_sd_m"] = nullptr;
  EXPECT_THAT(line_of(unknown), HasSubstr("98.1 ± ?"));
  json without = robot(40'000);
  without["sample"] = nullptr;
  EXPECT_THAT(line_of(without), Not(HasSubstr("±")));
}

// SAFETY: an old value never looks like a present one.
TEST(WatchLines, ValuesOlderThanASecondStandInBracketsThoughTheRobotIsConnected) {
  for (const std::int64_t age_us : {0, 999'000}) {
    EXPECT_THAT(line_of(robot(age_us)), Not(HasSubstr("("))) << age_us;
    EXPECT_THAT(line_of(robot(age_us), true), StartsWith("sim-1")) << age_us;
  }
  for (const json& old : {robot(1'100'000), robot(40'000, "disconnected")}) {
    EXPECT_THAT(line_of(old), HasSubstr("(98.1 ± 1.1)"));
    EXPECT_THAT(line_of(old), HasSubstr("(25 %)"));
    EXPECT_THAT(line_of(old), HasSubstr("(auto)"));
    EXPECT_THAT(line_of(old, true), StartsWith("\x1b[2m"));
  }
  json never = robot(0, "disconnected");
  never["last_received_at_us"] = nullptr;
  EXPECT_THAT(line_of(never), HasSubstr("LOST never"));
}

TEST(WatchLines, AStopIsShownAlsoWhileItIsNotConfirmed) {
  json stopping = robot(40'000);
  stopping["pending_stop"] = json::object();
  EXPECT_THAT(line_of(stopping), HasSubstr("stop not confirmed"));
  EXPECT_THAT(line_of(stopping, true), StartsWith("\x1b[1;31m"));
}

TEST(WatchLines, ANameCannotCommandTheTerminal) {
  json hostile = robot(40'000);
  hostile["control"] = {{"holder", "\x1b[2Janna\n"}};
  EXPECT_THAT(line_of(hostile), HasSubstr("\\x1B[2Janna\\x0A"));
}

TEST(WatchLines, AreCutByCharactersAndNotInTheMiddleOfOne) {
  for (std::size_t columns = 20; columns < 60; ++columns) {
    const std::string line = watch_lines(json::array({robot(40'000)}), kNowUs, columns, false).at(1);
    const auto characters = std::ranges::count_if(line, [](char c) { return (c & 0xC0) != 0x80; });
    EXPECT_LE(characters, static_cast<std::ptrdiff_t>(columns));
    EXPECT_FALSE(line.ends_with('\xC2')) << "half of ±";
  }
}

}  // namespace
}  // namespace server::cli
