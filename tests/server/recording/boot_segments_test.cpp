// Segments between boots and commits: what is enqueued when, and what a reader finds before it is durable.
#include "server/storage/ingest/boot_segments.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr storage::Interval kAllSamples{0, std::numeric_limits<std::uint64_t>::max()};
constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();

class BootSegmentsTest : public ::testing::Test {
 protected:
  // Its segments end at multiples of 100: it has the first key.
  BootSegmentsTest() : nemo_{connect(10, "nemo")} {}

  storage::BootEntry& connect(station::BootId boot_id, const station::RobotId& robot_id) {
    station::AdmissionRequest hello;
    hello.robot_id = robot_id;
    hello.boot_id = boot_id;
    storage::BootEntry& boot = boots_.enter(boot_id, robot_id);
    boots_.admit(boot, {}, {}, hello, 0);
    boot.connected = true;
    boots_.start(boot, 0);
    return boot;
  }
  static station::SampleBatch batch_of(std::uint64_t first_seq, std::size_t samples, float position_m = 1) {
    station::SampleBatch batch;
    batch.first_seq = first_seq;
    batch.first_robot_time_us = first_seq * 10'000;
    batch.context.period_us = 10'000;
    batch.received_at_us = static_cast<std::int64_t>(first_seq) + 1'000;
    batch.samples.resize(samples);
    for (station::Sample& sample : batch.samples) sample.position_m = position_m;
    return batch;
  }
  void receive(storage::BootEntry& boot, const station::SampleBatch& batch) {
    boot.recording.append(batch, 0, 0);
    boots_.watch(boot);
    queue_.count_received(batch.samples.size());
  }
  void receive(storage::BootEntry& boot, std::uint64_t first_seq, std::size_t samples, float position_m = 1) {
    receive(boot, batch_of(first_seq, samples, position_m));
  }
  void build_commit() { queue_.build_commit(boots_.with_records()); }

  std::vector<std::string> found(const storage::BootEntry& boot, storage::Interval range = kAllSamples,
                                 std::size_t limit = kNoLimit) {
    std::vector<std::string> parts;
    for (const storage::Segment& segment : waiting_samples(queue_, boot, range, limit)) {
      parts.push_back(std::to_string(segment.first_seq) + "-" + std::to_string(segment.next_seq() - 1));
    }
    return parts;
  }
  std::vector<std::string> gaps(const storage::BootEntry& boot, storage::Interval range = kAllSamples) {
    std::vector<std::string> parts;
    for (const storage::LostRange& gap : waiting_gaps(queue_, boot, range)) {
      parts.push_back(std::to_string(gap.lost.first) + "-" + std::to_string(gap.lost.next - 1) + " " + gap.cause);
    }
    return parts;
  }

  storage::BootRegistry boots_{1, 0};
  storage::CommitQueue queue_{1'000'000, 1000};
  storage::BootEntry& nemo_;
};

TEST_F(BootSegmentsTest, CompleteSegmentsAreDueAndTheRestOnceItIsOld) {
  receive(nemo_, 0, 150);
  enqueue_due(boots_, queue_, 0);
  EXPECT_EQ(nemo_.queued_segments, 1U);
  enqueue_due(boots_, queue_, 1'099'999);
  EXPECT_EQ(nemo_.queued_segments, 1U);
  enqueue_due(boots_, queue_, 1'100'000);
  EXPECT_EQ(nemo_.queued_segments, 2U);
  EXPECT_TRUE(nemo_.recording.waiting().empty());
}

TEST_F(BootSegmentsTest, WhatDoesNotFitIntoTheCommitIsNotTouched) {
  receive(nemo_, 0, storage::kMaxCommitSamples);
  storage::BootEntry& dory = connect(20, "dory");
  receive(dory, 0, 250);
  enqueue_due(boots_, queue_, 2'000'000);
  EXPECT_TRUE(queue_.has_full_commit());
  EXPECT_EQ(dory.queued_segments, 0U);
  build_commit();
  enqueue_due(boots_, queue_, 2'000'000);
  EXPECT_GT(dory.queued_segments, 0U);
  EXPECT_TRUE(dory.recording.waiting().empty());
}

TEST_F(BootSegmentsTest, EverythingIsEnqueuedOfEveryBoot) {
  storage::BootEntry& dory = connect(20, "dory");
  receive(nemo_, 0, 150);
  receive(dory, 0, 5);
  enqueue_everything(boots_, queue_);
  EXPECT_EQ(nemo_.queued_segments, 2U);
  EXPECT_EQ(dory.queued_segments, 1U);
}

TEST_F(BootSegmentsTest, AReaderFindsSamplesWhereverTheyWait) {
  storage::BootEntry& dory = connect(20, "dory");
  receive(dory, 0, 5);
  receive(nemo_, 200, 100);
  enqueue_due(boots_, queue_, 0);
  build_commit();  // with 200 to 299
  receive(nemo_, 100, 100);
  enqueue_due(boots_, queue_, 0);  // 100 to 199
  receive(nemo_, 300, 5);
  EXPECT_THAT(found(nemo_), ElementsAre("100-199", "200-299", "300-304"));
  EXPECT_THAT(found(nemo_, {150, 302}), ElementsAre("150-199", "200-299", "300-301"));
  EXPECT_THAT(found(nemo_, {305, 400}), IsEmpty());
  EXPECT_THAT(found(nemo_, kAllSamples, 101), ElementsAre("100-199", "200-299"));
  EXPECT_THAT(found(dory), ElementsAre("0-4"));
}

TEST_F(BootSegmentsTest, AReaderFindsSamplesAsTheDatabaseWillGiveThemBack) {
  receive(nemo_, 0, 1, -0.0F);
  receive(nemo_, 1, 1, std::numeric_limits<float>::infinity());
  const std::vector<storage::Segment> segments = waiting_samples(queue_, nemo_, kAllSamples, kNoLimit);
  ASSERT_EQ(segments.size(), 1U);
  EXPECT_FALSE(std::signbit(segments[0].samples.at(0).position_m));
  EXPECT_TRUE(std::isnan(segments[0].samples.at(1).position_m));
}

TEST_F(BootSegmentsTest, WhenASegmentHadArrivedIsKnownOnceNothingCanFollowInIt) {
  const auto times = [this] {
    std::vector<std::int64_t> found;
    for (const storage::Segment& segment : waiting_samples(queue_, nemo_, kAllSamples, kNoLimit)) {
      EXPECT_EQ(segment.first_received_at_us, static_cast<std::int64_t>(segment.first_seq) + 1'000);
      found.push_back(segment.received_at_us);
    }
    return found;
  };
  receive(nemo_, 0, 5);
  EXPECT_THAT(times(), ElementsAre(0)) << "5 may follow";
  receive(nemo_, 10, 5);
  EXPECT_THAT(times(), ElementsAre(0, 0)) << "what is missing may still come";
  receive(nemo_, 5, 5);
  EXPECT_THAT(times(), ElementsAre(1'005, 0)) << "10 is there already";
  receive(nemo_, 15, 85);
  EXPECT_THAT(times(), ElementsAre(1'005, 1'015)) << "the second is complete";
  receive(nemo_, 100, 1);
  enqueue_everything(boots_, queue_);
  EXPECT_THAT(times(), ElementsAre(1'005, 1'015, 1'100)) << "what is in the commit stays as it is";
}

TEST_F(BootSegmentsTest, AReaderFindsGapsWhereverTheyWait) {
  nemo_.recording.set_lost({50, 60}, "invalid", 0);
  boots_.watch(nemo_);
  build_commit();
  nemo_.recording.set_lost({10, 20}, "invalid", 0);
  boots_.watch(nemo_);
  EXPECT_THAT(gaps(nemo_), ElementsAre("10-19 invalid", "50-59 invalid"));
  EXPECT_THAT(gaps(nemo_, {20, 51}), ElementsAre("50-59 invalid"));
  EXPECT_THAT(gaps(connect(20, "dory")), IsEmpty());
}

// A segment stores one time and a period for all its samples; those of a batch may lie up to 100 µs beside them.
TEST_F(BootSegmentsTest, TheUncertaintyOfUtcHoldsForABatchWhoseTimesLieBesideTheSegments) {
  const auto stated_us = [this] {
    const auto segments = waiting_samples(queue_, nemo_, kAllSamples, kNoLimit);
    EXPECT_EQ(segments.size(), 1u);
    return segments.at(0).clock_uncertainty_us;
  };
  const auto send = [this](std::uint64_t first_seq, std::uint64_t later_us, std::int64_t offset_us) {
    station::SampleBatch batch = batch_of(first_seq, 5);
    batch.clock_uncertainty_us = 300;
    batch.first_robot_time_us += later_us;
    batch.utc_offset_us += offset_us;
    receive(nemo_, batch);
  };
  send(0, 0, 0);
  EXPECT_EQ(stated_us(), 300);
  send(5, 90, -90);  // another time of the robot, the same UTC
  EXPECT_EQ(stated_us(), 300);
  send(10, 90, 0);
  EXPECT_EQ(stated_us(), 390);
  send(15, 90, 40);
  EXPECT_EQ(stated_us(), 430);
}

}  // namespace
}  // namespace server
