// Rows of an export count what is missing before them, and a grid takes the nearest sample or none.
#include "server/storage/export/export_rows.hpp"

#include <gtest/gtest.h>

#include <random>
#include <utility>

#include "server/storage/runs/run_digest.hpp"

namespace server {
namespace {

storage::SpanSegment segment(std::uint32_t span, std::uint64_t first_seq, std::uint64_t first_robot_time_us,
                             std::size_t samples, std::uint32_t period_us = 10'000) {
  storage::SpanSegment part;
  part.span = span;
  part.span_first_seq = 5;
  part.segment.first_seq = first_seq;
  part.segment.first_robot_time_us = first_robot_time_us;
  part.segment.context.period_us = period_us;
  part.segment.utc_offset_us = 1'000'000;
  for (std::size_t index = 0; index < samples; ++index) {
    part.segment.samples.push_back({.position_m = static_cast<float>(first_seq + index)});
  }
  return part;
}

storage::SegmentPage page(std::vector<storage::SpanSegment> segments) {
  return {.segments = std::move(segments), .next = {}};
}

// A page does not tell whether the span of its last segment goes on.
TEST(SegmentRows, CountTheSamplesThatAreMissingAtTheEndOfASpan) {
  const auto ending = [](storage::SpanSegment part) {
    part.span_next_seq = 30;
    return part;
  };
  const auto more = [](std::vector<storage::SpanSegment> segments) {
    return storage::SegmentPage{.segments = std::move(segments), .next = storage::SampleCursor{}};
  };
  storage::SegmentRows rows;
  rows.give(more({ending(segment(0, 5, 0, 5)), ending(segment(0, 10, 0, 5))}));
  EXPECT_EQ(rows.next()->gap_after, 0u);
  EXPECT_FALSE(rows.next().has_value()) << "it is not known yet";
  rows.give(more({ending(segment(0, 20, 0, 4))}));
  EXPECT_EQ(rows.next()->part->segment.first_seq, 10u);
  EXPECT_FALSE(rows.next().has_value());
  rows.give(page({ending(segment(1, 5, 0, 25))}));
  storage::ExportSegment last = *rows.next();
  EXPECT_EQ(last.gap_before, 5u);
  EXPECT_EQ(last.gap_after, 6u);
  last = *rows.next();
  EXPECT_EQ(last.part->span, 1u);
  EXPECT_EQ(last.gap_after, 0u);
  EXPECT_FALSE(rows.next().has_value());
}

TEST(SegmentRows, CountTheSamplesThatAreMissingBeforeThem) {
  storage::SegmentRows rows;
  rows.give(page({segment(0, 7, 0, 3), segment(0, 10, 0, 2)}));
  EXPECT_EQ(rows.next()->gap_before, 2u);  // the span begins with 5
  EXPECT_EQ(rows.next()->gap_before, 0u);
  EXPECT_FALSE(rows.next().has_value());
  rows.give(page({segment(0, 20, 0, 1), segment(1, 5, 0, 1), segment(1, 7, 0, 1)}));
  EXPECT_EQ(rows.next()->gap_before, 8u);
  EXPECT_EQ(rows.next()->gap_before, 0u);
  EXPECT_EQ(rows.next()->gap_before, 1u);
  EXPECT_FALSE(rows.next().has_value());
}

TEST(SegmentRows, CountTheTicksThatTheRobotMissed) {
  storage::SegmentRows rows;
  rows.give(page({segment(0, 5, 0, 3), segment(0, 8, 90'000, 1), segment(0, 12, 140'100, 1),
                  segment(0, 13, 160'000, 1, 20'000), segment(0, 14, 240'000, 1, 20'000), segment(1, 5, 900'000, 1)}));
  EXPECT_EQ(rows.next()->missed_before, 0u);
  EXPECT_EQ(rows.next()->missed_before, 6u);
  const storage::ExportSegment after_gap = *rows.next();
  EXPECT_EQ(after_gap.gap_before, 3u);
  EXPECT_EQ(after_gap.missed_before, 1u) << "of five ticks four made a sample";
  EXPECT_EQ(rows.next()->missed_before, 0u) << "the period became longer";
  EXPECT_EQ(rows.next()->missed_before, 3u);
  EXPECT_EQ(rows.next()->missed_before, 0u) << "another span";
}

// Ticks at random with a sample each, or none; samples at random that are lost; segments that are cut at random.
TEST(SegmentRows, CountAsManyMissedTicksAsARecountAndAsTheDigest) {
  std::mt19937 random{12};
  for (int round = 0; round < 200; ++round) {
    std::vector<storage::SpanSegment> parts;
    std::uint64_t seq = 5, missed = 0, since_stored = 0, longest = 0;
    for (std::uint64_t tick = 0; tick < 200; ++tick) {
      const std::uint64_t time_us = 500'000 + tick * 10'000 + random() % 1000;
      if (random() % 10 == 0) {
        if (!parts.empty()) ++since_stored;
        continue;
      }
      const std::uint64_t made = seq++;
      if (random() % 10 == 0) continue;
      parts.push_back(segment(0, made, time_us, 1));
      missed += since_stored;
      longest = std::max(longest, std::exchange(since_stored, 0));
    }
    storage::SampleTally tally;
    tally.begin_span({5, seq}, 10'000);
    for (const storage::SpanSegment& part : parts) {
      tally.add({.samples = part.segment.interval(),
                 .first_robot_time_us = part.segment.first_robot_time_us,
                 .period_us = 10'000});
    }
    tally.end_span();
    std::uint64_t exported = 0;
    storage::SegmentRows rows;
    rows.give(page(std::move(parts)));
    while (const auto row = rows.next()) exported += row->missed_before;
    ASSERT_EQ(exported, missed) << round;
    ASSERT_EQ(tally.counts().missed, (storage::MissedTicks{.count = missed, .longest = longest})) << round;
  }
}

// The position of each row of the grid, -1 in a gap.
std::vector<float> positions(std::int64_t grid_us, const std::vector<storage::SegmentPage>& pages) {
  storage::GridRows grid{grid_us};
  std::vector<float> found;
  for (const storage::SegmentPage& one : pages) {
    grid.give(one);
    while (const auto row = grid.next()) found.push_back(row->sample == nullptr ? -1 : row->sample->position_m);
  }
  return found;
}

TEST(GridRows, TakeTheNearestSampleWithinHalfAPeriod) {
  const auto one = page({segment(0, 5, 1000, 4)});
  EXPECT_EQ(positions(10'000, {one}), (std::vector<float>{5, 6, 7, 8}));
  EXPECT_EQ(positions(20'000, {one}), (std::vector<float>{5, 7}));
  EXPECT_EQ(positions(5'000, {one}), (std::vector<float>{5, 5, 6, 6, 7, 7, 8}));  // of two as near the earlier
  EXPECT_EQ(positions(4'000, {one}), (std::vector<float>{5, 5, 6, 6, 7, 7, 7, 8}));
  EXPECT_EQ(positions(1'000'000, {one}), (std::vector<float>{5}));
}

TEST(GridRows, AreEmptyInAGapAndBeginAnewInEachSpan) {
  const auto first = page({segment(0, 5, 1000, 2)});
  const auto second = page({segment(0, 9, 43'000, 2), segment(1, 5, 7, 2)});
  EXPECT_EQ(positions(10'000, {first, second}), (std::vector<float>{5, 6, -1, -1, 9, 10, 5, 6}));
  storage::GridRows grid{10'000};
  grid.give(second);
  EXPECT_EQ(grid.next()->since_us, 0);
  const storage::GridRow row = *grid.next();
  EXPECT_EQ(row.since_us, 10'000);
  EXPECT_EQ(row.utc_us, 1'053'000);
}

TEST(GridRows, GoOnToTheEndOfTheSpan) {
  auto part = segment(0, 5, 1000, 2);
  part.span_next_seq = 10;
  EXPECT_EQ(positions(10'000, {page({part})}), (std::vector<float>{5, 6, -1, -1, -1}));
  EXPECT_EQ(positions(5'000, {page({part})}), (std::vector<float>{5, 5, 6, 6, -1, -1, -1, -1, -1}));
  part.span_next_seq = std::uint64_t{1} << 62;  // as a robot may say
  storage::GridRows grid{3'600'000'000};
  grid.give(page({part, segment(1, 5, 7, 2)}));
  for (int row = 0; row < 1000; ++row) ASSERT_TRUE(grid.next().has_value());
}

TEST(GridRows, AreThoseOfASearchOverAllSamples) {
  std::mt19937 random{7};
  for (int round = 0; round < 200; ++round) {
    std::vector<storage::SegmentPage> pages(1);
    std::uint64_t seq = 5;
    std::uint64_t time_us = random() % 1000;
    for (int part = 0; part < 8; ++part) {
      const std::uint32_t period_us = random() % 3 == 0 ? 7'000 : 10'000;
      const std::size_t samples = 1 + random() % 9;
      pages.back().segments.push_back(segment(0, seq, time_us, samples, period_us));
      seq += samples + random() % 3;
      time_us += samples * period_us + (random() % 2 == 0 ? random() % 40'000 : 0);
      if (random() % 3 == 0) pages.emplace_back();
    }
    const std::int64_t grid_us = 1'000 + random() % 30'000;
    std::vector<float> expected;
    const std::uint64_t begin_us = pages.front().segments.front().segment.first_robot_time_us;
    std::uint64_t end_us = 0;
    for (const storage::SegmentPage& one : pages) {
      for (const storage::SpanSegment& part : one.segments)
        end_us = part.segment.robot_time_us(part.segment.samples.size() - 1);
    }
    for (std::uint64_t at_us = begin_us; at_us <= end_us; at_us += static_cast<std::uint64_t>(grid_us)) {
      float nearest = -1;
      std::uint64_t distance_us = std::numeric_limits<std::uint64_t>::max();
      for (const storage::SegmentPage& one : pages) {
        for (const storage::SpanSegment& part : one.segments) {
          for (std::size_t index = 0; index < part.segment.samples.size(); ++index) {
            const std::uint64_t sample_us = part.segment.robot_time_us(index);
            const std::uint64_t away_us = sample_us > at_us ? sample_us - at_us : at_us - sample_us;
            if (2 * away_us > part.segment.context.period_us || away_us >= distance_us) continue;
            distance_us = away_us;
            nearest = part.segment.samples[index].position_m;
          }
        }
      }
      expected.push_back(nearest);
    }
    ASSERT_EQ(positions(grid_us, pages), expected) << round;
  }
}

}  // namespace
}  // namespace server
