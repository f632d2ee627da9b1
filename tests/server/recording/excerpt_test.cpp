// What a robot recorded in a window of time, and what of it is missing.
#include <algorithm>

#include "server/storage/query/span_finder.hpp"
#include "tests/server/recording/random_recording.hpp"

namespace server {
namespace {

constexpr std::int64_t kUtcOffsetUs = 1'700'000'000'000'000;  // of every TestRobot

class ExcerptTest : public RandomRecordingTest {
 protected:
  storage::Excerpt window(std::int64_t from_us, std::int64_t to_us) const {
    return {.run = {}, .robot_id = robot_.id, .window = storage::TimeWindow{from_us, to_us}};
  }
  std::int64_t utc_of(std::uint64_t seq) const { return kUtcOffsetUs + static_cast<std::int64_t>(robot_.time_of(seq)); }

  std::vector<std::uint64_t> seqs(const storage::Excerpt& excerpt, std::size_t limit) {
    std::vector<std::uint64_t> seen;
    std::optional<storage::SampleCursor> after;
    do {
      const storage::SegmentPage page = wait(history_->segments(excerpt, after, limit)).value();
      for (const storage::StoredSample& stored : samples_of(page).samples) seen.push_back(stored.seq);
      after = page.next;
    } while (after);
    return seen;
  }
  using RandomRecordingTest::samples_of;
  static storage::SamplePage samples_of(const storage::SegmentPage& page) { return server::storage::samples_of(page); }
};

TEST_F(ExcerptTest, PagesOfAWindowHoldItsSamplesWhetherStoredOrNot) {
  start();
  connect(robot_);
  make(robot_, 350);
  flush();
  make(robot_, 50);
  robot_.oldest_seq = robot_.next_seq = 500;  // 400 to 499 are lost
  make(robot_, 20);
  for (const auto& [first, next] : std::vector<std::pair<std::uint64_t, std::uint64_t>>{
           {0, 520}, {0, 1}, {99, 101}, {340, 360}, {380, 505}, {420, 430}, {399, 400}, {519, 520}, {519, 900}}) {
    SCOPED_TRACE(first);
    std::vector<std::uint64_t> expected;
    for (std::uint64_t seq = first; seq < std::min<std::uint64_t>(next, 520); ++seq) {
      if (seq < 400 || seq >= 500) expected.push_back(seq);
    }
    EXPECT_EQ(seqs(window(utc_of(first), utc_of(next)), 7), expected);
    EXPECT_EQ(seqs(window(utc_of(first) - 9'999, utc_of(next) - 9'999), 1000), expected);
  }
}

TEST_F(ExcerptTest, ManyBootsAreCutAFewAtATime) {
  start();
  connect(robot_);
  std::vector<station::BootId> boots;
  std::int64_t middle_us = 0;
  for (int boot = 0; boot < 210; ++boot) {
    make(robot_, 10);
    boots.push_back(robot_.boot_id);
    if (boot == 150) middle_us = utc_of(0);
    disconnect(robot_);
    robot_.boot_id += 1;
    robot_.next_seq = 0;
    robot_.late_us += 10'000'000;
    connect(robot_);
  }
  flush();
  const auto boots_in = [&](std::int64_t from_us) {
    std::vector<station::BootId> found;
    const auto spans = wait(history_->spans(window(from_us, utc_of(0)))).value();
    for (const storage::RecordedSpan& span : spans) found.push_back(span.boot_id);
    return found;
  };
  const std::uint64_t before = history_->reader().questions();
  EXPECT_EQ(boots_in(kUtcOffsetUs), boots);
  EXPECT_EQ(history_->reader().questions() - before, 4U) << "one for the list";
  EXPECT_EQ(boots_in(middle_us), std::vector<station::BootId>(boots.begin() + 150, boots.end()));
}

TEST_F(ExcerptTest, AWindowOverSeveralBootsHoldsThemInOrder) {
  start();
  connect(robot_);
  make(robot_, 30);
  robot_.boot_id += 1;
  robot_.next_seq = 0;
  robot_.late_us = 5'000'000;  // its time begins later, so that boots follow one another
  connect(robot_);
  make(robot_, 30);
  const std::vector<storage::StoredSample> found =
      samples_of(wait(history_->segments(window(kUtcOffsetUs + 700'000, utc_of(10)), {}, 1000)).value()).samples;
  ASSERT_EQ(found.size(), 20u);
  EXPECT_EQ(found.front().span, 0u);
  EXPECT_EQ(found.front().seq, 20u);
  EXPECT_EQ(found.back().span, 1u);
  EXPECT_EQ(found.back().seq, 9u);
  EXPECT_EQ(found.back().boot_id, robot_.boot_id);
}

TEST_F(ExcerptTest, GapsAreCutToTheWindow) {
  start();
  connect(robot_);
  make(robot_, 100);
  robot_.oldest_seq = robot_.next_seq = 200;
  make(robot_, 100);
  const storage::AbsencePage cut = wait(history_->gaps(window(utc_of(150), utc_of(250)))).value();
  ASSERT_EQ(cut.gaps.size(), 1u);
  EXPECT_EQ(cut.gaps[0].first_seq, 150u);
  EXPECT_EQ(cut.gaps[0].last_seq, 199u);
  EXPECT_EQ(cut.missing.size(), 0u);
  EXPECT_EQ(wait(history_->gaps(window(utc_of(0), utc_of(100))))->gaps.size(), 0u);
}

TEST_F(ExcerptTest, WhatIsNeitherStoredNorLostIsMissing) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  send(robot_, 0, 20);
  send(robot_, 50, 20);
  flush();
  send(robot_, 90, 10);
  const auto missing = [&](const storage::Excerpt& excerpt) {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;
    for (const storage::MissingRange& range : wait(history_->gaps(excerpt))->missing) {
      EXPECT_EQ(range.boot_id, robot_.boot_id);
      ranges.emplace_back(range.first_seq, range.last_seq);
    }
    return ranges;
  };
  using Ranges = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
  EXPECT_EQ(missing(storage::excerpt_of(run)), (Ranges{{20, 49}, {70, 89}}));
  EXPECT_EQ(missing(window(utc_of(30), utc_of(95))), (Ranges{{30, 49}, {70, 89}}));
  send(robot_, 20, 30);
  EXPECT_EQ(missing(storage::excerpt_of(run)), (Ranges{{70, 89}}));
  robot_.oldest_seq = 80;
  send(robot_, 100, 5);  // says that 70 to 79 are lost
  EXPECT_EQ(missing(storage::excerpt_of(run)), (Ranges{{80, 89}}));
}

// Pages of any size contain together what one page contains, each all of its part: no more than `limit` of either kind.
TEST_F(ExcerptTest, GapsComeInPages) {
  const storage::RunId run = record(14);
  std::size_t missing = 0;
  for (const bool stored : {false, true}) {
    SCOPED_TRACE(stored);
    if (stored) flush();
    for (const storage::Excerpt& excerpt : {storage::excerpt_of(run), window(utc_of(0), utc_of(1'000'000))}) {
      const storage::AbsencePage whole = wait(history_->gaps(excerpt)).value();
      ASSERT_GT(whole.gaps.size(), 3u);
      missing += whole.missing.size();
      for (const std::size_t limit : {std::size_t{1}, std::size_t{2}, whole.gaps.size() - 1, whole.gaps.size()}) {
        SCOPED_TRACE(limit);
        storage::AbsencePage together;
        std::size_t pages = 0;
        do {
          const storage::AbsencePage page = wait(history_->gaps(excerpt, together.next, limit)).value();
          ASSERT_LE(page.gaps.size(), limit);
          ASSERT_LE(page.missing.size(), limit);
          std::ranges::copy(page.gaps, std::back_inserter(together.gaps));
          std::ranges::copy(page.missing, std::back_inserter(together.missing));
          together.next = page.next;
          ASSERT_LE(++pages, whole.gaps.size() + whole.missing.size());
        } while (together.next);
        EXPECT_GE(pages, (whole.gaps.size() + limit - 1) / limit);
        const auto place = [](const auto& one) { return std::tuple{one.span, one.first_seq, one.last_seq}; };
        EXPECT_TRUE(std::ranges::equal(together.gaps, whole.gaps, {}, place, place));
        EXPECT_TRUE(std::ranges::equal(together.missing, whole.missing, {}, place, place));
      }
    }
  }
  EXPECT_GT(missing, 1u);
  EXPECT_EQ(wait(history_->gaps(storage::excerpt_of(run), {}, 0)).error().code, ErrorCode::invalid);
  EXPECT_EQ(wait(history_->gaps(storage::excerpt_of(run), {}, storage::kMaxPageGaps + 1)).error().code,
            ErrorCode::invalid);
}

// Each number up to the newest is in a sample, in a gap or missing, and only in one of them.
TEST_F(ExcerptTest, SamplesGapsAndWhatIsMissingMakeTheWhole) {
  std::size_t missing = 0;
  for (const unsigned seed : {11U, 12U, 13U, 14U}) {
    const storage::RunId run = record(seed);
    const storage::AbsencePage absences = wait(history_->gaps(storage::excerpt_of(run))).value();
    EXPECT_FALSE(absences.next.has_value());
    std::map<station::BootId, std::map<std::uint64_t, int>> times;
    for (const storage::StoredSample& stored : samples_of(run)) ++times[stored.boot_id][stored.seq];
    for (const storage::Gap& gap : absences.gaps) {
      for (std::uint64_t seq = gap.first_seq; seq <= gap.last_seq; ++seq) ++times[gap.boot_id][seq];
    }
    for (const storage::MissingRange& range : absences.missing) {
      for (std::uint64_t seq = range.first_seq; seq <= range.last_seq; ++seq) ++times[range.boot_id][seq];
    }
    EXPECT_GT(absences.gaps.size(), 0u);
    missing += absences.missing.size();
    ASSERT_EQ(times.size(), 2u);
    for (const auto& [boot_id, of_boot] : times) {
      EXPECT_EQ(of_boot.rbegin()->first - of_boot.begin()->first + 1, of_boot.size());
      for (const auto& [seq, count] : of_boot) EXPECT_EQ(count, 1) << seq;
    }
    EXPECT_EQ(times[robot_.boot_id].rbegin()->first, robot_.next_seq - 1);
    kill();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    robot_ = TestRobot{};
  }
  EXPECT_GT(missing, 0u);
}

TEST_F(ExcerptTest, WhatIsMissingIsTheSameInSlicesOfAnySize) {
  const storage::RunId run = record(14);
  const auto spans = wait(history_->spans(storage::excerpt_of(run))).value();
  SQLite::Database database = storage::open_for_reading(path_);
  std::vector<std::vector<std::uint64_t>> found;
  for (const std::size_t segments : {1u, 3u, 10'000u}) {
    std::vector<std::uint64_t>& numbers = found.emplace_back();
    for (const storage::RecordedSpan& span : spans) {
      storage::Interval left = span.made();
      while (left.first < left.next) {
        for (const storage::MissingRange& range : read_missing(database, span, left, segments)) {
          numbers.insert(numbers.end(), {range.boot_id, range.first_seq, range.last_seq});
        }
      }
    }
  }
  EXPECT_GT(found[0].size(), 0u);
  EXPECT_EQ(found[0], found[2]);
  EXPECT_EQ(found[1], found[2]);
}

// The station's clock was set back: what lies between the two ends that bear the time is one piece.
TEST_F(ExcerptTest, AClockThatWasSetBackLosesNothingOfTheWholeTime) {
  const storage::RunId run = record(13);
  std::int64_t first_us = std::numeric_limits<std::int64_t>::max();
  for (const storage::StoredSample& stored : samples_of(run)) first_us = std::min(first_us, stored.utc_us);
  const auto whole = wait(history_->segments({.run = {}, .robot_id = robot_.id, .window = {}}, {}, 10'000)).value();
  const auto window_of_all = wait(history_->segments(window(0, std::int64_t{1} << 52), {}, 10'000)).value();
  EXPECT_EQ(samples_of(window_of_all).samples.size(), samples_of(whole).samples.size());
  EXPECT_GT(samples_of(whole).samples.size(), 500u);
}

// A time that only one of the two stretches bears is found in it.
TEST_F(ExcerptTest, ATimeThatOccursOnceIsFoundAlthoughTheClockWasSetBack) {
  for (const microseconds step : {microseconds{-60s}, microseconds{60s}}) {
    start();
    connect(robot_);
    make_slowly(robot_, 500);
    clock_.step_utc(step);
    make_slowly(robot_, 500);
    flush();
    const storage::Excerpt all{.run = {}, .robot_id = robot_.id, .window = {}};
    const auto recorded = samples_of(wait(history_->segments(all, {}, 10'000)).value()).samples;
    ASSERT_EQ(recorded.size(), 1000u);
    for (const std::size_t index : {3u, 250u, 490u, 510u, 750u, 990u}) {
      const std::int64_t utc_us = recorded[index].utc_us;
      const auto found = samples_of(wait(history_->segments(window(utc_us, utc_us + 50'000), {}, 100)).value()).samples;
      ASSERT_FALSE(found.empty()) << index;
      EXPECT_EQ(found.front().seq, recorded[index].seq);
      EXPECT_EQ(found.size(), 5u);
    }
    kill();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    robot_ = TestRobot{};
  }
}

// There is one search from time to samples, also where the clock was set: a window and a run made afterwards agree.
TEST_F(ExcerptTest, ARunMadeOfATimeHoldsWhatAWindowOfThatTimeShows) {
  const auto numbers = [](const std::vector<storage::StoredSample>& samples) {
    std::vector<std::pair<station::BootId, std::uint64_t>> found;
    for (const storage::StoredSample& stored : samples) found.emplace_back(stored.boot_id, stored.seq);
    return found;
  };
  const storage::RunId all = record(13);
  flush();
  const std::vector<storage::StoredSample> recorded = samples_of(all);
  std::size_t found = 0;
  for (int i = 0; i < 40; ++i) {
    const std::int64_t from_us =
        recorded[random_() % recorded.size()].utc_us - static_cast<std::int64_t>(random_() % 9);
    const std::int64_t to_us = from_us + static_cast<std::int64_t>(random_() % 5'000'000);
    const auto seen =
        numbers(samples_of(wait(history_->segments(window(from_us, to_us + 1), {}, 10'000)).value()).samples);
    const Result<Run> run =
        wait(runs_->make_afterwards(robot_.id, named("afterwards"), storage::TimeSpan{from_us, to_us}, {}));
    EXPECT_EQ(run ? numbers(samples_of(run->id)) : decltype(seen){}, seen) << from_us << " to " << to_us;
    found += seen.size();
  }
  EXPECT_GT(found, 1000u);
}

TEST_F(ExcerptTest, SegmentsAreFoundByTheIndex) {
  start();
  for (const char* condition :
       {"first_seq <= 2 ORDER BY first_seq DESC LIMIT 1", "first_seq > 2 ORDER BY first_seq LIMIT 1"}) {
    const auto plan = rows(
        std::string{"EXPLAIN QUERY PLAN SELECT first_seq, last_seq FROM segment WHERE boot_key = 1 AND "} + condition);
    ASSERT_EQ(plan.size(), 1u);
    EXPECT_NE(plan[0].find("SEARCH segment USING INDEX segment_by_seq (boot_key=? AND first_seq"), std::string::npos);
  }
}

}  // namespace
}  // namespace server
