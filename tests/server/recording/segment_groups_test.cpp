// Overviews by groups of segments say what the samples say: in what a robot records, after retention has removed some,
// and in a database that had none.
#include "server/storage/groups/segment_groups.hpp"

#include <gmock/gmock.h>

#include "server/storage/upkeep/store_check.hpp"
#include "tests/server/recording/overview_fixture.hpp"

namespace server {
namespace {

class SegmentGroupsTest : public OverviewFixture {
 protected:
  void make_groups() {
    flush();
    wait(recording_->groups.pass());
  }
  std::int64_t groups() { return number("SELECT count(*) FROM segment_group"); }
  void change(const std::string& sql) {
    auto work = [&sql](storage::Database& database) {
      database.handle().exec(sql);
      return true;
    };
    ASSERT_TRUE(wait(recorder_->on_disk(std::move(work))));
  }
  // All points whose number allows groups: 0.4 of them fit into the run.
  void expect_truth(storage::RunId run) {
    const std::vector<storage::StoredSample> samples = samples_of(run);
    for (const std::size_t points : {1u, 2u, 5u, 7u}) {
      SCOPED_TRACE(points);
      const storage::OverviewColumns columns = overview(storage::excerpt_of(run), points).columns;
      EXPECT_TRUE(columns.from_segments);
      expect_same(columns, samples);
    }
  }
};

TEST_F(SegmentGroupsTest, WindowsOfABootFollowOneAnother) {
  for (const std::int64_t boot_key : {1, 2, 3, 50, 101}) {
    storage::Interval window = storage::group_window(boot_key, 0);
    EXPECT_EQ(window.first, 0u);
    for (int count = 0; count < 5; ++count) {
      EXPECT_EQ((window.next + 37 * static_cast<std::uint64_t>(boot_key - 1)) % 100, 0u) << "where segments end";
      EXPECT_LE(window.next - window.first, storage::kGroupNumbers);
      EXPECT_EQ(storage::group_window(boot_key, window.next - 1), window);
      const storage::Interval following = storage::group_window(boot_key, window.next);
      EXPECT_EQ(following.first, window.next);
      EXPECT_EQ(following.next - following.first, storage::kGroupNumbers);
      window = following;
    }
  }
}

TEST_F(SegmentGroupsTest, AnOverviewByGroupsSaysWhatAWalkOverTheSamplesSays) {
  for (const unsigned seed : {21U, 22U}) {
    SCOPED_TRACE(seed);
    const storage::RunId run = record(seed, 3500);
    make_groups();
    ASSERT_GE(groups(), 2);
    expect_truth(run);
    kill();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    robot_ = TestRobot{};
  }
}

TEST_F(SegmentGroupsTest, ADayOfPointsIsReadFromGroupsAlone) {
  const storage::RunId run = record_plain(45'000);
  make_groups();
  ASSERT_EQ(groups(), 7);  // 44,800 samples
  change("DELETE FROM segment_group WHERE first_seq = 12800");
  change("UPDATE segment SET min_duty = -0.5, max_duty = 0.5 WHERE first_seq < 12800 OR first_seq >= 19200");
  const storage::OverviewColumns columns = overview(storage::excerpt_of(run), 7).columns;
  const std::size_t duty = storage::overview_index(3);
  ASSERT_EQ(columns.samples.size(), 7u);
  for (std::size_t point = 0; point < 6; ++point) EXPECT_EQ(columns.max[duty][point], 0.0F) << point;
  EXPECT_EQ(columns.max[duty][6], 0.5F) << "the window that is not settled is read by segments";
  // Enough segments for the points, and too few groups.
  EXPECT_EQ(overview(storage::excerpt_of(run), 18).columns.max[duty].front(), 0.5F);
}

TEST_F(SegmentGroupsTest, AWindowInWhichASampleMayStillArriveHasNone) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  make(robot_, 3000, 25);
  robot_.next_seq += 25;  // on their way
  make(robot_, 11'000, 25);
  make_groups();
  EXPECT_EQ(groups(), 0);
  expect_truth(run);
  send(robot_, 3000, 25);
  make_groups();
  EXPECT_EQ(groups(), 2);
  expect_truth(run);
}

TEST_F(SegmentGroupsTest, AGroupGoesWithTheFirstOfItsSegments) {
  const storage::RunId run = record_plain(26'000);
  make_groups();
  ASSERT_EQ(groups(), 4);
  change("DELETE FROM segment WHERE first_seq BETWEEN 6400 AND 6600");  // as retention does: three of them
  EXPECT_EQ(rows("SELECT first_seq FROM segment_group"), (std::vector<std::string>{"0", "12800", "19200"}));
  expect_truth(run);
  change("DELETE FROM segment WHERE first_seq = 12700");
  EXPECT_EQ(groups(), 3);
  make_groups();
  EXPECT_EQ(groups(), 3) << "a window that was cut is read by segments";
  expect_truth(run);
}

TEST_F(SegmentGroupsTest, ADatabaseThatHadNoneGetsThemInTheBackground) {
  const storage::RunId run = record_plain(26'000);
  make_groups();
  const std::vector<std::string> made = rows("SELECT first_seq, samples, hex(extremes) FROM segment_group");
  change("DELETE FROM segment_group");
  change("UPDATE boot SET grouped_next_seq = 0");
  stop();
  start();
  expect_truth(run);
  clock_.run_for(90s);
  EXPECT_EQ(rows("SELECT first_seq, samples, hex(extremes) FROM segment_group"), made);
  expect_truth(run);
}

TEST_F(SegmentGroupsTest, VerifyFindsAGroupThatIsNotWhatItsSegmentsSay) {
  record_plain(20'000);
  make_groups();
  const auto faults = [this] {
    SQLite::Database database = storage::open_for_reading(path_);
    return storage::check_store(database, {.run = {}, .integrity = true}).value().faults;
  };
  EXPECT_EQ(faults().size(), 0u);
  change("UPDATE segment_group SET samples = samples - 1 WHERE first_seq = 6400");
  change("UPDATE segment_group SET extremes = zeroblob(80) WHERE first_seq = 12800");
  EXPECT_THAT(faults(),
              ::testing::ElementsAre(::testing::StartsWith("the group of samples 6400 to 12799 of boot key 1"),
                                     ::testing::StartsWith("the group of samples 12800 to 19199")));
}

TEST_F(SegmentGroupsTest, ARowWhoseNumbersAreNoWindowIsPassedOverAndNamed) {
  const storage::RunId run = record_plain(45'000);
  make_groups();
  change("UPDATE segment_group SET last_seq = 6399 WHERE first_seq = 6400");
  change("UPDATE segment_group SET last_seq = 9223372036854775807 WHERE first_seq = 19200");
  EXPECT_EQ(overview(storage::excerpt_of(run), 7).columns.samples.size(), 7u);
  SQLite::Database database = storage::open_for_reading(path_);
  EXPECT_THAT(storage::check_store(database, {.run = {}, .integrity = true}).value().faults,
              ::testing::ElementsAre(::testing::StartsWith("the group of samples 6400 to 6399 of boot key 1"),
                                     ::testing::StartsWith("the group of samples 19200 to 9223372036854775807")));
}

// Such as versions before this one may have stored.
TEST_F(SegmentGroupsTest, AWindowIntoWhichASegmentReachesHasNone) {
  const storage::RunId run = record_plain(20'000);
  make_groups();
  change("DELETE FROM segment_group");
  change("UPDATE boot SET grouped_next_seq = 0");
  change("UPDATE segment SET last_seq = last_seq - 50, last_row = last_row - 50 WHERE first_seq = 6300");
  change(
      "UPDATE segment SET first_seq = first_seq - 50, first_row = first_row - 50, last_seq = last_seq - 50,"
      " last_row = last_row - 50, first_robot_time_us = first_robot_time_us - 500000 WHERE first_seq = 6400");
  change(
      "UPDATE segment SET first_seq = first_seq - 50, first_row = first_row - 50,"
      " first_robot_time_us = first_robot_time_us - 500000 WHERE first_seq = 6500 AND last_seq - first_seq < 50");
  make_groups();
  EXPECT_EQ(rows("SELECT first_seq FROM segment_group"), (std::vector<std::string>{"12800"}));
  EXPECT_EQ(number("SELECT grouped_next_seq FROM boot"), 19'200);
  const storage::OverviewColumns columns = overview(storage::excerpt_of(run), 5).columns;
  std::uint64_t samples = 0;
  for (const std::uint64_t each : columns.samples) samples += each;
  EXPECT_EQ(static_cast<std::int64_t>(samples), number("SELECT sum(last_seq - first_seq + 1) FROM segment"));
}

}  // namespace
}  // namespace server
