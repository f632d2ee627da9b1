// A search ends on time in virtual time: every look at the clock takes a tick.
#include "control/search/search_limit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <thread>
#include <vector>

#include "control/search/output_error_search.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

struct TickingClock {
  double tick_s = 1e-3;
  long* looks;
  double operator()() const { return tick_s * static_cast<double>(++*looks); }
};

Recording long_run(std::size_t samples) {
  const std::vector<double> duty = prbs_duty(1, 0.2, 0.01 * static_cast<double>(samples - 1), 0.01);
  Recording run = position_run(kNonNewtonianModel, duty, 1e-3, 4);
  run.velocity_m_s = output_of(kNonNewtonianModel, Channel::velocity, 0.01, duty);
  add_noise(run.velocity_m_s, 1e-2, 8);
  return run;
}

TEST(SearchLimit, IsReachedOnceAndStaysReached) {
  double now_s = 0;
  SearchLimit limit(9, {}, [&] { return now_s; });
  now_s = 8.9;
  EXPECT_FALSE(limit.is_reached() || limit.has_passed());
  now_s = 9;
  EXPECT_TRUE(limit.has_passed());  // also where nothing has checked it
  EXPECT_FALSE(limit.end());
  EXPECT_TRUE(limit.is_reached());
  now_s = 0;
  EXPECT_TRUE(limit.is_reached() && limit.has_passed());
  EXPECT_EQ(limit.end(), SearchEnd::time_limit);
}

bool have_equal_bits(const SearchPoint& a, const SearchPoint& b) {
  const auto values = [](const SearchPoint& p) {
    return std::array{p.model.kp,        p.model.b1,        p.model.b2,
                      p.model.alpha,     p.model.beta,      p.offset_m,
                      p.sensor.first_s,  p.sensor.period_s, p.sensor.time_constant_s,
                      p.position_clock_s};
  };
  return std::bit_cast<std::array<std::uint64_t, 10>>(values(a)) ==
         std::bit_cast<std::array<std::uint64_t, 10>>(values(b));
}

// However long each look at the clock takes: the search of one structure does not use up the time of another.
TEST(SearchLimit, ASearchThatEndsFindsTheSameBitsOnAFastAndASlowMachine) {
  const Recording run = long_run(301);
  IdentificationOptions options;
  options.time_limit_s = 1e5;
  std::vector<SearchPoint> first;
  for (const double look_s : {0.0, 1e-3, 1.0}) {
    long looks = 0;
    OutputErrorSearch search(run, options, TickingClock{look_s, &looks});
    std::vector<SearchPoint> found;
    for (const Structure structure : {Structure::first_order, Structure::second_order, Structure::fractional}) {
      found.push_back(search.run(structure).point);
    }
    ASSERT_FALSE(search.limit().has_passed());
    if (first.empty()) first = found;
    EXPECT_TRUE(std::ranges::equal(first, found, have_equal_bits)) << look_s;
  }
}

TEST(SearchLimit, ASearchBesideBusyLoopsFindsTheSameBits) {
  Recording run{0.01, prbs_duty(0.6, 0.2, 6, 0.01), {}, {}};
  run.acceleration_m_s2 = output_of({0.1, 0.006, 0.11, 1, 2, 1}, Channel::acceleration, 0.01, run.duty);
  add_noise(run.acceleration_m_s2, 0.01, 5);
  IdentificationOptions options;
  options.further_starts = 1;
  const Identification alone = identify(run, options);
  std::atomic<bool> goes_on = true;
  std::vector<std::jthread> loops;
  for (int i = 0; i < 4; ++i) {
    loops.emplace_back([&] {
      while (goes_on) std::atomic_signal_fence(std::memory_order_seq_cst);
    });
  }
  const Identification beside = identify(run, options);
  goes_on = false;
  EXPECT_TRUE(have_equal_bits({alone.best.model}, {beside.best.model}));
  EXPECT_EQ(std::bit_cast<std::uint64_t>(alone.best.sse), std::bit_cast<std::uint64_t>(beside.best.sse));
  EXPECT_EQ(alone.best.one_sigma, beside.best.one_sigma);
  EXPECT_EQ(alone.warnings, beside.warnings);
}

TEST(SearchLimit, CallsTheProgressFunctionAfterALongSilence) {
  double now_s = 0;
  int calls = 0;
  SearchLimit limit(100, [&](const Progress&) { return ++calls < 2; }, [&] { return now_s; });
  EXPECT_FALSE(limit.is_reached());
  EXPECT_EQ(calls, 0);
  now_s = 0.2;
  EXPECT_FALSE(limit.is_reached());
  EXPECT_EQ(calls, 1);
  now_s = 0.4;
  EXPECT_TRUE(limit.is_reached());
  EXPECT_TRUE(limit.is_reached());
  EXPECT_EQ(limit.end(), SearchEnd::cancelled);
  EXPECT_EQ(calls, 2);
}

TEST(SearchLimit, EndsTheDeadTimeScanAndTheResponsesOfOneDelay) {
  const Recording run = long_run(601);
  IdentificationOptions options;
  options.longest_dead_time_s = 0.2;
  for (const double limit_s : {1e-9, 0.05, 0.3, 1.0}) {
    options.time_limit_s = limit_s;
    long looks = 0;
    OutputErrorSearch search(run, options, TickingClock{1e-3, &looks});
    const SearchResult found = search.run(Structure::fractional);
    EXPECT_EQ(found.end, SearchEnd::time_limit);
    EXPECT_LE(looks, 1000 * limit_s + 10);  // so nothing long is done without a look, or after the end
    const auto residuals = search.residuals(found.point);
    EXPECT_TRUE(residuals[0].allFinite() && residuals[1].allFinite());
  }
}

TEST(SearchLimit, LeavesNoWorkButTheStartWhenNoTimeIsLeft) {
  IdentificationOptions options;
  options.time_limit_s = 1e-9;
  long looks = 0;
  OutputErrorSearch search(long_run(301), options, TickingClock{1, &looks});
  for (const Structure structure : {Structure::first_order, Structure::second_order, Structure::fractional}) {
    const SearchResult found = search.run(structure);
    EXPECT_EQ(found.starts, 0);
    EXPECT_EQ(found.end, SearchEnd::time_limit);
  }
  EXPECT_LE(search.outputs_computed(), 6);  // one start of each, for two channels
}

TEST(SearchLimit, CancelsWithinAnIteration) {
  IdentificationOptions options = unhurried_options();
  options.longest_dead_time_s = 0.2;
  int calls = 0;
  long looks = 0, looks_when_cancelled = 0;
  options.on_progress = [&](const Progress&) {
    looks_when_cancelled = looks;
    return ++calls < 3;
  };
  OutputErrorSearch search(long_run(301), options, TickingClock{1e-2, &looks});
  EXPECT_EQ(search.run(Structure::fractional).end, SearchEnd::cancelled);
  EXPECT_EQ(calls, 3);
  EXPECT_LE(looks, 100);  // the watcher is asked at least every eleventh look, in the first dead times
  EXPECT_LE(looks - looks_when_cancelled, 2);
}

TEST(SearchLimit, AnUntriedStructureLosesNoComparison) {
  IdentificationOptions options = unhurried_options();
  options.on_progress = [](const Progress& progress) { return progress.structure == Structure::first_order; };
  const Identification found = identify(long_run(301), options);
  ASSERT_EQ(found.compared.size(), 3U);
  EXPECT_EQ(found.compared.back().structure, Structure::fractional);
  EXPECT_EQ(found.compared.back().starts, 0);
  EXPECT_EQ(found.compared.back().end, SearchEnd::cancelled);
  EXPECT_THAT(found.warnings, Contains(HasSubstr("the fractional model was not tried")));
  EXPECT_THAT(found.warnings, Not(Contains(HasSubstr("does not call for fractional orders"))));
}

}  // namespace
}  // namespace control
