// The commit queue by itself: what goes into which commit, what stays when it fails, and what is bounded.
#include "server/storage/ingest/commit_queue.hpp"

#include <gtest/gtest.h>

namespace server {
namespace {

class CommitQueueTest : public ::testing::Test {
 protected:
  CommitQueueTest() {
    for (storage::BootEntry* boot : {&nemo_, &dory_}) {
      storage::StoredBoot stored;
      stored.key = boot == &nemo_ ? 1 : 2;
      boot->recording.load(std::move(stored));
      boot->connected = true;
    }
  }
  // One segment for each hundred samples of the first boot.
  void receive(storage::BootEntry& boot, std::uint64_t first_seq, std::size_t samples) {
    station::SampleBatch batch;
    batch.first_seq = first_seq;
    batch.first_robot_time_us = first_seq * 10'000;
    batch.context.period_us = 10'000;
    batch.samples.resize(samples);
    boot.recording.append(batch, 0, 0);
    queue_.count_received(samples);
  }
  static station::CommandRecord command(station::CommandId id, const std::string& kind) {
    station::CommandRecord record;
    record.id = id;
    record.kind = kind;
    return record;
  }

  storage::BootEntry nemo_{10, "nemo"};
  storage::BootEntry dory_{20, "dory"};
  storage::BootsWithRecords with_records_;
  storage::CommitQueue queue_{1000, 3};
};

TEST_F(CommitQueueTest, HasNoCommitOfNothing) {
  queue_.build_commit(with_records_);
  EXPECT_FALSE(queue_.has_commit());
}

TEST_F(CommitQueueTest, CompleteSegmentsFirstOrAllOfThem) {
  receive(nemo_, 0, 250);
  queue_.enqueue_segments(nemo_, false);
  EXPECT_EQ(nemo_.queued_segments, 2u);
  queue_.enqueue_segments(nemo_, true);
  EXPECT_EQ(nemo_.queued_segments, 3u);
  EXPECT_EQ(queue_.end(), 3u);
}

TEST_F(CommitQueueTest, ABootWithoutConnectionGivesAll) {
  receive(nemo_, 0, 150);
  nemo_.connected = false;
  queue_.enqueue_segments(nemo_, false);
  EXPECT_EQ(nemo_.queued_segments, 2u);
}

TEST_F(CommitQueueTest, TheCommitSaysHowFarEachBootWillBeDurable) {
  receive(dory_, 0, 5);
  receive(nemo_, 0, 100);
  queue_.enqueue_segments(dory_, true);
  queue_.enqueue_segments(nemo_, true);
  queue_.build_commit(with_records_);
  const storage::WriteBatch& commit = queue_.commit();
  ASSERT_EQ(commit.progress.size(), 2u);
  EXPECT_EQ(commit.progress[0].boot_key, 2);
  EXPECT_EQ(commit.progress[0].durable_next_seq, 5u);
  EXPECT_EQ(commit.progress[1].durable_next_seq, 100u);
  EXPECT_EQ(queue_.position(), 2u);
  EXPECT_TRUE(nemo_.in_commit.is_listed());
}

TEST_F(CommitQueueTest, AFailedCommitStaysAndNothingPassesIt) {
  receive(nemo_, 0, 5);
  queue_.enqueue_segments(nemo_, true);
  queue_.build_commit(with_records_);
  receive(nemo_, 5, 5);
  queue_.enqueue_segments(nemo_, true);
  EXPECT_TRUE(queue_.has_commit());
  EXPECT_EQ(queue_.commit().segments.size(), 1u);
  EXPECT_EQ(queue_.samples(), 10u);
  const storage::WriteBatch written = queue_.finish_commit();
  EXPECT_EQ(written.segments.size(), 1u);
  EXPECT_EQ(queue_.samples(), 5u);
  EXPECT_FALSE(queue_.has_commit());
  EXPECT_EQ(queue_.take_finished(), &nemo_);
  EXPECT_EQ(queue_.take_finished(), nullptr);
  queue_.build_commit(with_records_);
  EXPECT_EQ(queue_.commit().segments.at(0).first_seq, 5u);
}

TEST_F(CommitQueueTest, WhatIsBeyondACommitGoesIntoTheNext) {
  constexpr std::size_t kTooMany = storage::kMaxCommitSamples + 150;
  receive(nemo_, 0, kTooMany);
  queue_.enqueue_segments(nemo_, true);
  EXPECT_TRUE(queue_.has_full_commit());
  queue_.build_commit(with_records_);
  const storage::WriteBatch first = queue_.finish_commit();
  EXPECT_EQ(first.segments.size(), storage::kMaxCommitSamples / 100);
  EXPECT_FALSE(queue_.has_full_commit());
  EXPECT_EQ(queue_.samples(), 150u);
  queue_.build_commit(with_records_);
  EXPECT_EQ(queue_.commit().segments.size(), 2u);
  EXPECT_EQ(queue_.position(), queue_.end());
}

TEST_F(CommitQueueTest, AStartWaitsForTheSegmentsBeforeIt) {
  receive(nemo_, 0, storage::kMaxCommitSamples + 100);
  queue_.enqueue_segments(nemo_, true);
  queue_.enqueue_start(dory_, {.robot_id = "dory", .boot_key = 2});
  receive(nemo_, storage::kMaxCommitSamples + 100, 5);
  queue_.enqueue_segments(nemo_, true);
  EXPECT_EQ(queue_.end_of_starts(), queue_.end() - 1);
  queue_.build_commit(with_records_);
  EXPECT_TRUE(queue_.finish_commit().boots.empty());
  EXPECT_EQ(dory_.queued_starts, 1u);
  queue_.build_commit(with_records_);
  EXPECT_EQ(queue_.commit().boots.size(), 1u);
  EXPECT_EQ(dory_.queued_starts, 1u);
  EXPECT_TRUE(queue_.has_starts());
  queue_.finish_commit();
  EXPECT_EQ(dory_.queued_starts, 0u);
  EXPECT_FALSE(queue_.has_starts());
}

TEST_F(CommitQueueTest, ALaterStartOfABootTakesThePlaceOfTheQueuedOne) {
  queue_.enqueue_start(nemo_, {.robot_id = "nemo", .boot_key = 1, .announced_next_seq = 1});
  queue_.enqueue_start(nemo_, {.robot_id = "nemo", .boot_key = 1, .announced_next_seq = 2});
  EXPECT_EQ(nemo_.queued_starts, 1u);
  queue_.build_commit(with_records_);
  ASSERT_EQ(queue_.commit().boots.size(), 1u);
  EXPECT_EQ(queue_.commit().boots[0].announced_next_seq, 2u);
}

TEST_F(CommitQueueTest, GapsGoWithTheNextCommit) {
  nemo_.recording.set_lost_below(7, "ring_overrun", 0);
  with_records_.add(nemo_);
  queue_.build_commit(with_records_);
  ASSERT_EQ(queue_.commit().gaps.size(), 1u);
  EXPECT_EQ(queue_.commit().progress.at(0).durable_next_seq, 7u);
  EXPECT_TRUE(with_records_.empty());
}

TEST_F(CommitQueueTest, ACommandIsQueuedOnceInItsLatestState) {
  EXPECT_FALSE(queue_.replace(command(1, "setpoint")));
  queue_.enqueue(command(1, "setpoint"));
  queue_.enqueue(command(2, "mode"));
  EXPECT_TRUE(queue_.replace(command(1, "later")));
  queue_.build_commit(with_records_);
  ASSERT_EQ(queue_.commit().commands.size(), 2u);
  EXPECT_EQ(queue_.commit().commands[0].kind, "later");
  EXPECT_FALSE(queue_.replace(command(1, "too late")));  // the commit is as it is
}

TEST_F(CommitQueueTest, IsBounded) {
  EXPECT_TRUE(queue_.has_room_for_samples(1000));
  EXPECT_FALSE(queue_.has_room_for_samples(1001));
  receive(nemo_, 0, 501);
  EXPECT_FALSE(queue_.is_half_empty_of_samples());
  EXPECT_FALSE(queue_.has_room_for_samples(500));
  queue_.enqueue(station::AuditNote{});
  EXPECT_TRUE(queue_.is_half_empty_of_records());
  queue_.enqueue(command(1, "mode"));
  EXPECT_FALSE(queue_.is_half_empty_of_records());
  EXPECT_TRUE(queue_.has_room_for_record());
  queue_.enqueue(storage::StoredEvent{});
  EXPECT_FALSE(queue_.has_room_for_record());
  queue_.build_commit(with_records_);
  EXPECT_TRUE(queue_.has_room_for_record());  // whatever is in the commit
}

TEST_F(CommitQueueTest, FindsTheSegmentsOfABootWhereverTheyWait) {
  receive(nemo_, 0, 100);
  queue_.enqueue_segments(nemo_, true);
  queue_.build_commit(with_records_);
  receive(nemo_, 100, 100);
  receive(dory_, 100, 100);
  queue_.enqueue_segments(dory_, true);
  queue_.enqueue_segments(nemo_, true);
  EXPECT_EQ(queue_.segments_of(nemo_, {0, 200}).size(), 2u);
  ASSERT_EQ(queue_.segments_of(nemo_, {100, 101}).size(), 1u);
  EXPECT_EQ(queue_.segments_of(nemo_, {100, 101})[0]->first_seq, 100u);
  EXPECT_TRUE(queue_.segments_of(nemo_, {200, 300}).empty());
}

}  // namespace
}  // namespace server
