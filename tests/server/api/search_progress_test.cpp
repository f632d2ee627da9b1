// The progress of an identification: each of its searches says what it is for, and the share never falls.
#include "server/analysis/search/search_progress.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/control/recorded_runs.hpp"

namespace server::analysis {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

struct Reported {
  std::vector<double> shares;
  std::vector<std::string> stages;
};

// Of the job, whose search has all structures.
control::IdentificationOptions watched(Reported& reported, SearchShare& share) {
  control::IdentificationOptions options = control::unhurried_options();
  options.further_starts = 0;
  options.tries_dead_time = true;
  options.on_progress = [&reported, &share](const control::Progress& progress) {
    reported.shares.push_back(share.at(progress));
    reported.stages.push_back(in_words(progress));
    return true;
  };
  return options;
}

control::Recording late_run(double dead_time_s) {
  const std::vector<double> duty = control::prbs_duty(0.6, 0.4, 20, 0.01);
  control::Recording run{0.01, duty, {}, {}};
  run.position_m = control::output_of(control::kNonNewtonianModel, control::Channel::position, 0.01, duty, dead_time_s);
  control::add_noise(run.position_m, 5e-4, 3);
  return run;
}

TEST(SearchProgress, ASecondSearchSaysWhatItIsForAndTheShareNeverFalls) {
  Reported reported;
  SearchShare share{false};
  const auto found = control::identify(late_run(0.05), watched(reported, share));
  EXPECT_GT(found.best.model.dead_time_s, 0);
  EXPECT_THAT(reported.stages, Contains("for a dead time, before the first start"));
  EXPECT_THAT(reported.stages, Contains(StartsWith("for a dead time, fractional: start 1 of 1, iteration ")));
  EXPECT_THAT(reported.stages.front(), Not(HasSubstr("for a dead time")));
  EXPECT_TRUE(std::ranges::is_sorted(reported.shares));
  EXPECT_EQ(reported.shares.front(), 0);
  EXPECT_GT(reported.shares.back(), 0.8);
  EXPECT_LT(reported.shares.back(), 1);
}

TEST(SearchProgress, OneSearchIsForNoDeadTime) {
  Reported reported;
  SearchShare share{false};
  control::identify(late_run(0), watched(reported, share));
  EXPECT_THAT(reported.stages, Not(Contains(HasSubstr("dead time"))));
  EXPECT_TRUE(std::ranges::is_sorted(reported.shares));
  EXPECT_LT(reported.shares.back(), 0.8);
}

TEST(SearchProgress, OneStructureIsTheWholeOfASearch) {
  SearchShare all{false}, one{true};
  const control::Progress half{.structure = control::Structure::first_order, .start = 1, .starts = 2};
  EXPECT_DOUBLE_EQ(all.at(half), 0.8 / 6);
  EXPECT_DOUBLE_EQ(one.at(half), 0.8 / 2);
}

}  // namespace
}  // namespace server::analysis
