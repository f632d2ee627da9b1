// A scan gives what a plain query over segments and rows gives, for random recordings, ranges and channels.
#include "server/storage/samples/sample_scanner.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr storage::Interval kAll{0, std::numeric_limits<std::uint64_t>::max()};

std::string text_of(float value) { return std::isnan(value) ? "none" : fmt::format("{}", value); }

class SampleScannerTest : public RecordingTest {
 protected:
  float value() {
    switch (random_() % 8) {
      case 0: return kNaN;
      case 1: return -0.0F;
      case 2: return std::numeric_limits<float>::infinity();
      case 3: return std::numeric_limits<float>::denorm_min();
      default: return static_cast<float>(random_() % 2000) / 7 - 100;
    }
  }

  station::SampleContext context() {
    station::SampleContext context = manual_at_100_hz();
    context.mode = random_() % 2 == 0 ? rheonaut_MODE_AUTO : rheonaut_MODE_EMERGENCY;
    context.sub_state = random_() % 2 == 0 ? rheonaut_SUB_STATE_NAVIGATING : rheonaut_SUB_STATE_NONE;
    if (random_() % 2 == 0) context.setpoint_m = static_cast<float>(random_() % 10) / 10;
    context.disturbance_m = static_cast<float>(random_() % 3) / 100;
    context.position_sd_m = random_() % 4 == 0 ? std::nullopt : std::optional{0.001F};
    context.controller_id = random_() % 2 == 0 ? 0xffffffffU : 3;
    context.emergency_id = random_() % 2 == 0 ? 0xfedcba9876543210 : 0;
    context.emergency_cause =
        random_() % 2 == 0 ? rheonaut_EMERGENCY_CAUSE_OPERATOR : rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK;
    context.flags = random_() % 64;
    return context;
  }

  // Samples of any value, sometimes after a loss; a new context now and then.
  void make_some(TestRobot& robot) {
    if (random_() % 4 == 0) robot.context = context();
    if (random_() % 6 == 0) robot.oldest_seq = robot.next_seq += random_() % 50;  // the ring ran over
    station::SampleBatch batch = robot.batch(robot.next_seq, 1 + random_() % 25);
    for (station::Sample& sample : batch.samples) sample = {value(), value(), value(), value(), value(), value()};
    if (random_() % 10 == 0) batch.clock_uncertainty_us = -1;
    send(robot, batch);
    robot.next_seq = batch.next_seq();
  }

  // Three robots in turns, each with a reboot; everything is stored.
  void record() {
    start();
    std::vector<TestRobot> robots(3);
    for (std::size_t index = 0; index < robots.size(); ++index) {
      robots[index].id = fmt::format("robot-{}", index);
      robots[index].boot_id = 100 * (index + 1);
      connect(robots[index]);
    }
    for (int round = 0; round < 150; ++round) {
      TestRobot& robot = robots[random_() % robots.size()];
      if (round == 80) {
        robot.boot_id += 1;
        robot.next_seq = robot.oldest_seq = 0;
        connect(robot);
      }
      make_some(robot);
      if (random_() % 3 == 0) clock_.run_for(microseconds{random_() % 300'000});
    }
    flush();
  }

  // One line per sample, as stored.
  std::vector<std::string> plain(std::int64_t boot_key, storage::Interval range, storage::Channels channels) {
    SQLite::Database database = storage::open_for_reading(path_);
    SQLite::Statement query{
        database,
        "SELECT first_seq + row - first_row, first_robot_time_us + (row - first_row) * period_us, utc_offset_us,"
        " clock_uncertainty_us, first_received_at_us, received_at_us, mode, sub_state, emergency_cause, setpoint_m,"
        " disturbance_m, position_sd_m, controller_id, printf('%llu', emergency_id), flags, position_m, velocity_m_s,"
        " acceleration_m_s2, duty, impedance_mv, reference_m"
        " FROM segment JOIN sample ON row BETWEEN first_row AND last_row WHERE boot_key = ? ORDER BY 1"};
    query.bind(1, boot_key);
    std::vector<std::string> lines;
    const auto number = [&query](int column) {
      return query.getColumn(column).isNull() ? kNaN : static_cast<float>(query.getColumn(column).getDouble());
    };
    while (query.executeStep()) {
      const auto seq = static_cast<std::uint64_t>(query.getColumn(0).getInt64());
      if (seq < range.first || seq >= range.next) continue;
      std::string line;
      for (int column = 0; column < 9; ++column) line += query.getColumn(column).getString() + " ";
      for (int column = 9; column < 12; ++column) line += text_of(number(column)) + " ";
      for (int column = 12; column < 15; ++column) line += query.getColumn(column).getString() + " ";
      for (std::size_t index = 0; index < storage::kChannels; ++index) {
        line += text_of(channels[index] ? number(15 + static_cast<int>(index)) : kNaN) + " ";
      }
      lines.push_back(line);
    }
    return lines;
  }

  static std::string line_of(const storage::Segment& segment, std::size_t index) {
    const station::SampleContext& context = segment.context;
    const station::Sample& sample = segment.samples[index];
    std::string line = fmt::format(
        "{} {} {} {} {} {} {} {} {} {} {} {} {} {} {} ", segment.first_seq + index, segment.robot_time_us(index),
        segment.utc_offset_us, segment.clock_uncertainty_us, segment.first_received_at_us, segment.received_at_us,
        protocol::text(context.mode), protocol::text(context.sub_state), protocol::text(context.emergency_cause),
        text_of(context.setpoint_m.value_or(kNaN)), text_of(context.disturbance_m.value_or(kNaN)),
        text_of(context.position_sd_m.value_or(kNaN)), context.controller_id, context.emergency_id, context.flags);
    for (const float value : {sample.position_m, sample.velocity_m_s, sample.acceleration_m_s2, sample.duty,
                              sample.impedance_mv, sample.reference_m}) {
      line += text_of(value) + " ";
    }
    return line;
  }

  static std::vector<std::string> scanned(storage::SampleScanner& scanner, std::int64_t boot_key,
                                          storage::Interval range) {
    std::vector<std::string> lines;
    storage::Segment segment;
    scanner.begin(boot_key, range);
    while (scanner.next(segment)) {
      EXPECT_EQ(segment.boot_key, boot_key);
      EXPECT_FALSE(segment.samples.empty());
      EXPECT_LE(segment.samples.size(), 100u);
      for (std::size_t index = 0; index < segment.samples.size(); ++index) lines.push_back(line_of(segment, index));
    }
    return lines;
  }

  std::mt19937 random_;
};

class RandomRecording : public SampleScannerTest, public ::testing::WithParamInterface<unsigned> {};

TEST_P(RandomRecording, AScanGivesWhatAPlainQueryGives) {
  random_.seed(GetParam());
  record();
  SQLite::Database database = storage::open_for_reading(path_);
  const std::int64_t boots = number("SELECT max(boot_key) FROM boot");
  EXPECT_EQ(boots, 4);
  for (int round = 0; round < 20; ++round) {
    const storage::Channels channels = round == 0 ? storage::all_channels() : storage::Channels{random_() % 64};
    storage::SampleScanner scanner{database, channels};
    for (std::int64_t boot_key = 1; boot_key <= boots + 1; ++boot_key) {
      const std::uint64_t first = random_() % 600;
      const storage::Interval range = round == 0 ? kAll : storage::Interval{first, first + random_() % 300};
      SCOPED_TRACE(fmt::format("boot {}, {} to {}", boot_key, range.first, range.next));
      EXPECT_EQ(scanned(scanner, boot_key, range), plain(boot_key, range, channels));
    }
  }
}

TEST_P(RandomRecording, HeadsHoldTheExtremesOfTheirSegments) {
  random_.seed(GetParam());
  record();
  SQLite::Database database = storage::open_for_reading(path_);
  const storage::Interval range{50, 400};
  storage::Channels channels;
  channels.set(0).set(4);
  storage::SampleScanner scanner{database, channels};
  for (std::int64_t boot_key = 1; boot_key <= 4; ++boot_key) {
    for (const storage::SegmentHead& head :
         read_heads(database, boot_key, range, storage::overview_channels(channels))) {
      EXPECT_TRUE(head.first_seq < range.next && head.next_seq > range.first);
      storage::Segment segment;
      scanner.begin(boot_key, {head.first_seq, head.next_seq});
      ASSERT_TRUE(scanner.next(segment));
      EXPECT_EQ(segment.first_seq, head.first_seq);
      EXPECT_EQ(segment.next_seq(), head.next_seq);
      EXPECT_EQ(segment.first_robot_time_us, head.first_robot_time_us);
      EXPECT_EQ(segment.context.period_us, head.period_us);
      EXPECT_EQ(segment.utc_offset_us, head.utc_offset_us);
      EXPECT_EQ(segment.clock_uncertainty_us, head.clock_uncertainty_us);
      EXPECT_EQ(segment.context.flags, head.flags);
      station::Sample low{kNaN, kNaN, kNaN, kNaN, kNaN, kNaN}, high = low;
      for (const station::Sample& sample : segment.samples) {
        low.position_m = std::fmin(low.position_m, sample.position_m);
        high.position_m = std::fmax(high.position_m, sample.position_m);
        low.impedance_mv = std::fmin(low.impedance_mv, sample.impedance_mv);
        high.impedance_mv = std::fmax(high.impedance_mv, sample.impedance_mv);
      }
      EXPECT_EQ(text_of(head.min[storage::overview_index(0)]), text_of(low.position_m));
      EXPECT_EQ(text_of(head.max[storage::overview_index(0)]), text_of(high.position_m));
      EXPECT_EQ(text_of(head.min[storage::overview_index(4)]), text_of(low.impedance_mv));
      EXPECT_EQ(text_of(head.max[storage::overview_index(4)]), text_of(high.impedance_mv));
      EXPECT_TRUE(std::isnan(head.min[storage::overview_index(1)]) && std::isnan(head.max[storage::overview_index(5)]));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomRecording, ::testing::Range(1u, 9u));

TEST_F(SampleScannerTest, AScanThatStopsEarlyLetsGoOfTheDatabase) {
  record();
  SQLite::Database database = storage::open_for_reading(path_);
  storage::SampleScanner scanner{database, storage::all_channels()};
  storage::Segment segment;
  scanner.begin(1, kAll);
  ASSERT_TRUE(scanner.next(segment));
  scanner.end();
  EXPECT_FALSE(scanner.next(segment));
  stop();  // empties the write-ahead log, which is possible only while nobody reads in it
  EXPECT_EQ(std::filesystem::file_size(path_.string() + "-wal"), 0u);
}

TEST_F(SampleScannerTest, AnEmptyRangeAndAnUnknownBootHaveNoSamples) {
  record();
  SQLite::Database database = storage::open_for_reading(path_);
  storage::SampleScanner scanner{database, storage::all_channels()};
  EXPECT_TRUE(scanned(scanner, 1, {5, 5}).empty());
  EXPECT_TRUE(scanned(scanner, 1, {7, 5}).empty());
  EXPECT_TRUE(scanned(scanner, 99, kAll).empty());
  EXPECT_TRUE(storage::read_heads(database, 1, {5, 5}, storage::OverviewChannels{}.set()).empty());
  EXPECT_TRUE(read_heads(database, 99, kAll, storage::OverviewChannels{}.set()).empty());
}

TEST_F(SampleScannerTest, AMissingRowIsDamageAndNotASample) {
  TestRobot robot;
  start();
  connect(robot);
  make(robot, 30);
  stop();
  SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
  database.exec("DELETE FROM sample WHERE row = 12");
  storage::SampleScanner scanner{database, storage::all_channels()};
  storage::Segment segment;
  scanner.begin(1, kAll);
  EXPECT_THROW(scanner.next(segment), std::runtime_error);
  scanner.begin(1, {0, 11});
  EXPECT_TRUE(scanner.next(segment));
  EXPECT_EQ(segment.next_seq(), 11u);
}

TEST_F(SampleScannerTest, SegmentsAreFoundByIndex) {
  record();
  std::vector<std::string> plan;
  for (const std::string& row :
       rows("EXPLAIN QUERY PLAN SELECT first_seq FROM segment WHERE boot_key = 1 AND first_seq >= 200 - 99"
            " AND first_seq <= 300 AND last_seq >= 200 ORDER BY first_seq")) {
    plan.push_back(row.substr(row.rfind('|') + 1));
  }
  EXPECT_EQ(plan, (std::vector<std::string>{
                      "SEARCH segment USING INDEX segment_by_seq (boot_key=? AND first_seq>? AND first_seq<?)"}));
}

}  // namespace
}  // namespace server
