// A search ends on time in virtual time: every look at the clock takes a tick.
#include "control/search/search_limit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(SearchLimit, SharesTheTimeThatIsLeft) {
  double now_s = 0;
  SearchLimit limit(9, {}, [&] { return now_s; });
  limit.begin_share(3);
  now_s = 2.9;
  EXPECT_FALSE(limit.is_reached());
  now_s = 3;
  EXPECT_TRUE(limit.is_reached());
  limit.begin_share(2);
  now_s = 5.9;
  EXPECT_FALSE(limit.is_reached());
  limit.begin_share(1);
  now_s = 9;
  EXPECT_TRUE(limit.is_reached());
  EXPECT_EQ(limit.end(), SearchEnd::time_limit);
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
  limit.begin_share(1);
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
  int parts = 3;
  for (const Structure structure : {Structure::first_order, Structure::second_order, Structure::fractional}) {
    const SearchResult found = search.run(structure, parts--);
    EXPECT_EQ(found.starts, 0);
    EXPECT_EQ(found.end, SearchEnd::time_limit);
  }
  EXPECT_LE(search.outputs_computed(), 6);  // one start of each, for two channels
}

TEST(SearchLimit, ReachesEveryStructureWhenTheFirstWouldTakeAllTheTime) {
  IdentificationOptions options;
  options.further_starts = 1000;
  options.time_limit_s = 2;
  long looks = 0;
  OutputErrorSearch search(long_run(301), options, TickingClock{1e-3, &looks});
  int parts = 3;
  for (const Structure structure : {Structure::first_order, Structure::second_order, Structure::fractional}) {
    const SearchResult found = search.run(structure, parts--);
    EXPECT_GE(found.starts, 1);
    EXPECT_EQ(found.end, SearchEnd::time_limit);
  }
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
