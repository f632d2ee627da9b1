// What a loop that stood still makes of what it then reads, and the clock that shows it.
#include "server/runtime/loop_watch.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <string>

#include "server/runtime/clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;

TEST(LoopWatch, WhatIsReadFirstAfterAStandstillIsAsOldAsTheTurnBefore) {
  runtime::LoopWatch watch;
  watch.turn(1'000'000);
  EXPECT_EQ(watch.unread_for(4'000'000), 3s);
  watch.turn(4'010'000);
  EXPECT_EQ(watch.unread_for(4'020'000), 3'020ms) << "until all has been read";
  watch.rest();
  EXPECT_EQ(watch.unread_for(4'030'000), 0s);
}

TEST(LoopWatch, ABusyLoopHasNotStoodStill) {
  runtime::LoopWatch watch;
  EXPECT_EQ(watch.unread_for(1'000'000), 0s) << "the first turn there is";
  for (int i = 1; i <= 10; ++i) EXPECT_EQ(watch.unread_for(1'000'000 + i * 200'000), 0s);
  EXPECT_GT(watch.unread_for(3'200'001), 200ms);
}

TEST(LoopWatch, OfTwoStandstillsTheFirstCountsUntilAllHasBeenRead) {
  runtime::LoopWatch watch;
  watch.turn(1'000'000);
  watch.turn(2'000'000);
  EXPECT_EQ(watch.unread_for(4'000'000), 3s);
  watch.rest();
  EXPECT_EQ(watch.unread_for(5'000'000), 1s);
}

// Where the machine has never been suspended since it was started, both clocks of the system say the same; then only
// the run by the next test can fail.
TEST(SystemClock, SteadyTimeGoesOnInASuspend) {
  boost::asio::io_context loop{1};
  const runtime::SystemClock clock{loop};
  const auto since_boot_us = [] {
    timespec now{};
    clock_gettime(CLOCK_BOOTTIME, &now);
    return now.tv_sec * 1'000'000 + now.tv_nsec / 1000;
  };
  const std::int64_t before_us = since_boot_us();
  const std::int64_t at_us = clock.steady_us();
  EXPECT_LE(before_us, at_us);
  EXPECT_LE(at_us, since_boot_us());
}

// In a time namespace CLOCK_BOOTTIME is a day ahead of CLOCK_MONOTONIC, as after a suspend of a day.
TEST(SystemClock, SteadyTimeHasGoneOnInASuspendOfADay) {
  const std::string after_a_day = "unshare --map-root-user --fork --time --boottime 86400 ";
  if (std::system((after_a_day + "true 2>/dev/null").c_str()) != 0) {
    GTEST_SKIP() << "unshare --time is not possible here: no clock that has seen a suspend";
  }
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  const std::string one_case = " --gtest_filter=SystemClock.SteadyTimeGoesOnInASuspend";
  // Without the shards of CTest, which would leave the case out and pass.
  EXPECT_EQ(std::system((after_a_day + "env -u GTEST_TOTAL_SHARDS -u GTEST_SHARD_INDEX " + program + one_case).c_str()),
            0);
}

}  // namespace
}  // namespace server
