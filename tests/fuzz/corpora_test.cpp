// Gives each fuzz target every input of its folder in tests/data/fuzz: what a fuzzer has found once is tested in every
// build.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/fuzz/targets.hpp"

namespace fuzz {
namespace {

void replay(const std::string& name, int (*target)(const std::uint8_t*, std::size_t)) {
  int inputs = 0;
  for (const auto& entry : std::filesystem::directory_iterator{TEST_DATA_DIR "/fuzz/" + name}) {
    std::ifstream file{entry.path(), std::ios::binary};
    const std::vector<char> bytes{std::istreambuf_iterator<char>{file}, std::istreambuf_iterator<char>{}};
    std::fprintf(stderr, "%s\n", entry.path().filename().c_str());  // the last one printed is the one that aborts
    target(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    ++inputs;
  }
  EXPECT_GT(inputs, 0) << name;
}

TEST(Corpora, Body) { replay("body", fuzz::body); }
TEST(Corpora, Config) { replay("config", fuzz::config); }
TEST(Corpora, Cookie) { replay("cookie", fuzz::cookie); }
TEST(Corpora, Foxglove) { replay("foxglove", fuzz::foxglove); }
TEST(Corpora, Frame) { replay("frame", fuzz::frame); }
TEST(Corpora, Profile) { replay("profile", fuzz::profile); }
TEST(Corpora, Query) { replay("query", fuzz::query); }
TEST(Corpora, Robot) { replay("robot", fuzz::robot); }
TEST(Corpora, Scenario) { replay("scenario", fuzz::scenario); }

}  // namespace
}  // namespace fuzz
