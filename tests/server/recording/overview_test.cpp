// Overviews say what the samples say: the same extremes as a walk over every sample, with nothing twice and nothing
// left out.
#include "server/storage/query/overview.hpp"

#include <algorithm>
#include <set>

#include "tests/server/recording/overview_fixture.hpp"

namespace server {
namespace {

class OverviewTest : public OverviewFixture {};

TEST_F(OverviewTest, SaysWhatAWalkOverTheSamplesSays) {
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    SCOPED_TRACE(seed);
    const storage::RunId run = record(seed);
    const std::vector<storage::StoredSample> samples = samples_of(run);
    ASSERT_GT(samples.size(), 500u);
    const auto commits = recorder_->counters().commits;
    std::set<bool> sources;
    for (const std::size_t points : {1u, 2u, 3u, 7u, 50u, 300u, 10'000u}) {
      SCOPED_TRACE(points);
      const storage::OverviewColumns columns = overview(storage::excerpt_of(run), points).columns;
      EXPECT_LE(columns.samples.size(), points);
      expect_same(columns, samples);
      sources.insert(columns.from_segments);
    }
    EXPECT_EQ(sources.size(), 2u) << "segments and rows";
    EXPECT_EQ(recorder_->counters().commits, commits);
    kill();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    robot_ = TestRobot{};
  }
}

TEST_F(OverviewTest, SaysTheSameOnceTheLastSamplesAreStored) {
  const storage::RunId run = record(5);
  const std::vector<storage::StoredSample> samples = samples_of(run);
  const storage::OverviewColumns before = overview(storage::excerpt_of(run), 20).columns;
  EXPECT_LT(number("SELECT count(*) FROM run_sample"), static_cast<std::int64_t>(samples.size()));
  flush();
  const storage::OverviewColumns after = overview(storage::excerpt_of(run), 20).columns;
  EXPECT_EQ(before.samples, after.samples);
  EXPECT_EQ(before.last_utc_us, after.last_utc_us);
  expect_same(after, samples);
}

TEST_F(OverviewTest, ListsTheGaps) {
  const storage::RunId run = record(6);
  const storage::GapPage first = overview(storage::excerpt_of(run), 50).gaps;
  const std::vector<storage::Gap>& gaps = first.gaps;
  EXPECT_FALSE(first.next.has_value());
  const std::vector<storage::Gap> listed = wait(history_->gaps(storage::excerpt_of(run)))->gaps;
  ASSERT_GT(gaps.size(), 1u);
  ASSERT_EQ(gaps.size(), listed.size());
  for (std::size_t index = 0; index < gaps.size(); ++index) EXPECT_EQ(gaps[index].first_seq, listed[index].first_seq);
}

TEST_F(OverviewTest, HoldsOnlyTheChannelsThatAreAskedFor) {
  const storage::RunId run = record(7);
  const std::vector<storage::StoredSample> samples = samples_of(run);
  const auto channels = storage::parse_overview_channels("duty,estimated_position_m,position_m,setpoint_m").value();
  for (const std::size_t points : {3u, 500u}) {
    const storage::OverviewColumns columns = overview(storage::excerpt_of(run), points, channels).columns;
    expect_same(columns, samples, channels);
    for (std::size_t channel = 0; channel < storage::kOverviewChannels; ++channel) {
      EXPECT_EQ(columns.min[channel].empty(), !channels[channel]);
    }
  }
}

// 0.4 of the points, or a segment to a point.
TEST_F(OverviewTest, ReadsRowsOnlyWhileSegmentsAreTooFew) {
  const storage::RunId run = record_plain(2000);
  ASSERT_EQ(number("SELECT count(*) FROM segment"), 20);
  EXPECT_TRUE(overview(storage::excerpt_of(run), 20).columns.from_segments);
  EXPECT_TRUE(overview(storage::excerpt_of(run), 50).columns.from_segments);
  EXPECT_FALSE(overview(storage::excerpt_of(run), 51).columns.from_segments);
  EXPECT_EQ(overview(storage::excerpt_of(run), 20).columns.samples, (std::vector<std::uint64_t>(20, 100)));
  EXPECT_EQ(overview(storage::excerpt_of(run), 50).columns.samples, (std::vector<std::uint64_t>(20, 100)));
  EXPECT_EQ(overview(storage::excerpt_of(run), 200).columns.samples, (std::vector<std::uint64_t>(200, 10)));
}

TEST_F(OverviewTest, ARunWithoutSamplesHasNoPoints) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  EXPECT_EQ(overview(storage::excerpt_of(run), 2000).columns.samples.size(), 0u);
  EXPECT_EQ(wait(history_->overview(storage::excerpt_of(99), {})).error().code, ErrorCode::not_found);
  EXPECT_EQ(wait(history_->overview({.run = {}, .robot_id = "nobody", .window = {}}, {})).error().code,
            ErrorCode::not_found);
}

TEST_F(OverviewTest, AWindowOfARobotHoldsTheSamplesOfThatTime) {
  record_plain(2000);
  const std::int64_t begin_us = 1'700'000'000'500'000;  // of sample 0
  for (const std::pair<std::int64_t, std::int64_t> window :
       {std::pair{0L, 1L << 52}, {500L, 600L}, {499L, 601L}, {0L, 1L}, {1999L, 2000L}, {1234L, 1999L}}) {
    const auto [first, next] = window;
    SCOPED_TRACE(first);
    const storage::TimeWindow asked{begin_us + first * 10'000, begin_us + std::min(next, 100'000L) * 10'000};
    const storage::Excerpt excerpt{.run = {}, .robot_id = robot_.id, .window = asked};
    for (const std::size_t points : {2u, 700u}) {
      const storage::OverviewColumns columns = overview(excerpt, points).columns;
      EXPECT_EQ(columns.first_utc_us.front(), asked.from_us);
      EXPECT_EQ(columns.last_utc_us.back(), begin_us + (std::min(next, 2000L) - 1) * 10'000);
    }
  }
  const storage::Excerpt before{.run = {}, .robot_id = robot_.id, .window = storage::TimeWindow{0, begin_us}};
  const storage::Excerpt after{
      .run = {}, .robot_id = robot_.id, .window = storage::TimeWindow{begin_us + 20'000'000, 1L << 53}};
  EXPECT_EQ(overview(before, 10).columns.samples.size(), 0u);
  EXPECT_EQ(overview(after, 10).columns.samples.size(), 0u);
}

// Each slice is a question of its own, after which a coroutine may be cancelled.
TEST_F(OverviewTest, AsksInSlices) {
  const storage::RunId run = record_plain(45'000);
  const auto questions_for = [&](std::size_t points) {
    const auto before = history_->reader().questions();
    overview(storage::excerpt_of(run), points);
    return history_->reader().questions() - before;
  };
  EXPECT_EQ(questions_for(100), 3u);     // spans, gaps, segments
  EXPECT_EQ(questions_for(10'000), 5u);  // spans, gaps, and 20,000 rows thrice
}

TEST_F(OverviewTest, HoldsARobotThatBeginsFarAhead) {
  start();
  robot_.next_seq = robot_.oldest_seq = std::uint64_t{1} << 61;
  connect(robot_);
  make(robot_, 20);
  const storage::Excerpt all{.run = {}, .robot_id = robot_.id, .window = {}};
  const storage::OverviewColumns columns = overview(all, 10'000).columns;
  EXPECT_EQ(columns.samples, (std::vector<std::uint64_t>{20}));
  EXPECT_EQ(wait(history_->gaps(all))->missing.size(), 0u);
}

// More segments than a slice reads.
TEST_F(OverviewTest, SlicesOfSegmentsJoinWithoutASeam) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  for (int sample = 0; sample < 5'050; ++sample) {
    robot_.context.mode = sample % 2 == 0 ? rheonaut_MODE_AUTO : rheonaut_MODE_MANUAL;
    make(robot_, 1);
  }
  flush();
  ASSERT_EQ(number("SELECT count(*) FROM segment"), 5'050);
  const storage::OverviewColumns columns = overview(storage::excerpt_of(run), 50).columns;
  EXPECT_TRUE(columns.from_segments);
  EXPECT_EQ(columns.samples, (std::vector<std::uint64_t>(50, 101)));
  expect_same(columns, samples_of(run));
}

TEST_F(OverviewTest, TheCountOfSegmentsIsAnsweredByTheIndexAlone) {
  start();
  const auto plan = rows(
      "EXPLAIN QUERY PLAN SELECT count(*) FROM (SELECT 1 FROM segment WHERE boot_key = 1 AND first_seq >= 2 AND"
      " first_seq < 3 LIMIT 4)");
  ASSERT_FALSE(plan.empty());
  const auto holds = [](const std::string& row) {
    return row.find("USING COVERING INDEX segment_by_seq (boot_key=? AND first_seq>? AND first_seq<?)") !=
           std::string::npos;
  };
  EXPECT_TRUE(std::ranges::any_of(plan, holds));
}

}  // namespace
}  // namespace server
