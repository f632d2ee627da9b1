// The power fails at random calls of SQLite, and nothing that was acknowledged is lost; two mistakes that would lose
// something are found. RHEONAUT_POWER_CUTS and RHEONAUT_POWER_CUT_SEED (of the first life) make it longer or another.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <spdlog/spdlog.h>

#include <cstdlib>

#include "tests/server/recording/station_life.hpp"

namespace server {
namespace {

constexpr int kCutsInALife = 8;
constexpr unsigned kSeedsApart = 1'000'000;

int number_from(const char* variable, int fallback) {
  const char* value = std::getenv(variable);
  return value == nullptr ? fallback : std::stoi(value);
}

class PowerCutTest : public ::testing::TestWithParam<unsigned> {
 protected:
  PowerCutTest() { spdlog::set_level(spdlog::level::off); }  // the disk fails in every life
  ~PowerCutTest() override { spdlog::set_level(spdlog::level::info); }

  // Cuts until a fault is found, or `limit`.
  int live(unsigned first_seed, int limit, Mutant mutant) {
    int cuts = 0;
    for (unsigned seed = first_seed; cuts < limit && faults_.empty(); ++seed) {
      StationLife life{seed, mutant};
      faults_ = life.live(std::min(kCutsInALife, limit - cuts));
      cuts += static_cast<int>(life.cuts().size());
      for (const std::string& call : life.cuts()) ++cuts_by_call_[call];
    }
    return cuts;
  }

  void print_cuts() const {
    for (const auto& [call, cuts] : cuts_by_call_) fmt::print("{:6} {}\n", cuts, call);
  }

  Faults faults_;
  std::map<std::string, int> cuts_by_call_;
};

TEST_P(PowerCutTest, LosesNothingThatWasAcknowledged) {
  const auto first_seed = static_cast<unsigned>(number_from("RHEONAUT_POWER_CUT_SEED", 1)) + GetParam() * kSeedsApart;
  const int wanted = number_from("RHEONAUT_POWER_CUTS", 100);
  const int cuts = live(first_seed, wanted, Mutant::none);
  fmt::print("{} cuts from seed {}: {} faults\n", cuts, first_seed, faults_.size());
  print_cuts();
  EXPECT_THAT(faults_, ::testing::IsEmpty());
  EXPECT_GE(cuts, wanted);
}

using PowerCutSeedTest = PowerCutTest;

// Each of these lives showed a fault once.
TEST_F(PowerCutSeedTest, WhatWasFoundOnceIsNotFoundAgain) {
  // 1001117: the first page was torn while the file was begun, in the step after the first.
  for (const unsigned seed : {1'001'117U}) EXPECT_GT(live(seed, kCutsInALife, Mutant::none), 0);
  EXPECT_THAT(faults_, ::testing::IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Seeds, PowerCutTest, ::testing::Range(0u, 3u));

using PowerCutMutantTest = PowerCutTest;

TEST_P(PowerCutMutantTest, SynchronousOffIsFound) {
  const int cuts = live(GetParam(), 200, Mutant::synchronous_off);
  ASSERT_FALSE(faults_.empty());
  fmt::print("found after {} cuts: {}\n", cuts, faults_.front());
}

TEST_P(PowerCutMutantTest, AnAcknowledgementBeforeTheCommitIsFound) {
  const int cuts = live(GetParam(), 200, Mutant::acknowledges_on_reception);
  ASSERT_FALSE(faults_.empty());
  fmt::print("found after {} cuts: {}\n", cuts, faults_.front());
}

INSTANTIATE_TEST_SUITE_P(Seeds, PowerCutMutantTest, ::testing::Values(1u, 1001u, 2001u));

}  // namespace
}  // namespace server
