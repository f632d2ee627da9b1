// The registry of boots by itself: who is admitted, what is to be done with which boot, and when it is forgotten.
#include "server/storage/ingest/boot_registry.hpp"

#include <gtest/gtest.h>

namespace server {
namespace {

constexpr std::int64_t kSecond = 1'000'000;
constexpr auto kAccepted = rheonaut_REFUSAL_REASON_NONE;

class BootRegistryTest : public ::testing::Test {
 protected:
  static station::AdmissionRequest hello(const station::RobotId& robot_id, station::BootId boot_id,
                                         std::uint64_t next_seq = 0) {
    station::AdmissionRequest request;
    request.robot_id = robot_id;
    request.boot_id = boot_id;
    request.next_seq = next_seq;
    request.received_at_us = 5 * kSecond;
    return request;
  }
  station::Admission admit(const station::AdmissionRequest& request, storage::StoredBoot stored = {},
                           std::int64_t now_us = 0) {
    storage::BootEntry& boot = boots_.enter(request.boot_id, request.robot_id);
    return boots_.admit(boot, std::move(stored), {}, request, now_us);
  }
  storage::BootRegistry::Started connect(station::BootId boot_id, const station::RobotId& robot_id = "nemo") {
    EXPECT_EQ(admit(hello(robot_id, boot_id)).refusal, kAccepted);
    storage::BootEntry& boot = *boots_.find(boot_id);
    boot.connected = true;
    return boots_.start(boot, 0);
  }
  storage::BootEntry& receive(station::BootId boot_id, std::uint64_t first_seq, std::size_t samples,
                              std::int64_t now_us) {
    station::SampleBatch batch;
    batch.first_seq = first_seq;
    batch.context.period_us = 10'000;
    batch.samples.resize(samples);
    storage::BootEntry& boot = *boots_.find(boot_id);
    boot.recording.append(batch, 0, now_us);
    boots_.watch(boot);
    return boot;
  }

  storage::BootRegistry boots_{7, 0};
};

TEST_F(BootRegistryTest, NumbersNewBootsAndKeepsTheKeysOfStoredOnes) {
  storage::StoredBoot stored;
  stored.key = 3;
  admit(hello("nemo", 10));
  admit(hello("dory", 11), std::move(stored));
  admit(hello("bruce", 12));
  EXPECT_EQ(boots_.find(10)->recording.key(), 7);
  EXPECT_EQ(boots_.find(11)->recording.key(), 3);
  EXPECT_EQ(boots_.find(12)->recording.key(), 8);
  EXPECT_TRUE(boots_.find(10)->with_records.is_listed());  // it is to be stored
  EXPECT_FALSE(boots_.find(11)->with_records.is_listed());
}

TEST_F(BootRegistryTest, RefusesWhatCannotBeTheSameBoot) {
  EXPECT_EQ(admit(hello("nemo", 10, 100)).refusal, kAccepted);
  EXPECT_EQ(admit(hello("nemo", 10, 99)).refusal, rheonaut_REFUSAL_REASON_BOOT_ID_REUSED);
  EXPECT_EQ(admit(hello("dory", 10, 100)).refusal, rheonaut_REFUSAL_REASON_BOOT_ID_REUSED);
  EXPECT_EQ(admit(hello("nemo", 10, 100)).refusal, kAccepted);
}

TEST_F(BootRegistryTest, AStartReplacesTheBootsThatHaveConnected) {
  connect(10);
  EXPECT_EQ(admit(hello("nemo", 11)).refusal, kAccepted);  // and never connects
  connect(20, "dory");
  const storage::BootRegistry::Started started = connect(12);
  EXPECT_EQ(started.start.boot_key, boots_.find(12)->recording.key());
  ASSERT_EQ(started.replaced.size(), 1u);
  EXPECT_EQ(started.replaced[0]->boot_id, 10u);
  EXPECT_EQ(boots_.find_recorded(10), nullptr);
  EXPECT_NE(boots_.find_recorded(12), nullptr);
  EXPECT_NE(boots_.find_recorded(20), nullptr);
  EXPECT_EQ(admit(hello("nemo", 10)).refusal, rheonaut_REFUSAL_REASON_STATION_BUSY);
}

TEST_F(BootRegistryTest, AnotherBootStartsUntilItIsStored) {
  connect(10);
  const std::int64_t later_us = 1;  // than the admission of that boot
  EXPECT_TRUE(boots_.another_starts(hello("nemo", 11), 0));
  EXPECT_FALSE(boots_.another_starts(hello("nemo", 11), later_us));
  boots_.find(10)->queued_starts = 1;
  EXPECT_TRUE(boots_.another_starts(hello("nemo", 11), later_us));
  EXPECT_FALSE(boots_.another_starts(hello("nemo", 10), later_us));
  EXPECT_FALSE(boots_.another_starts(hello("dory", 11), later_us));
}

TEST_F(BootRegistryTest, ACompleteSegmentIsDueAtOnceAndARestWhenItIsOld) {
  connect(10);
  storage::BootEntry& boot = receive(10, 0, 50, kSecond);
  EXPECT_EQ(boots_.take_due(), nullptr);
  receive(10, 50, 100, kSecond);  // segments of the seventh boot end elsewhere than at a hundred
  EXPECT_EQ(boots_.take_due(), &boot);
  EXPECT_EQ(boots_.take_due(), nullptr);
  EXPECT_EQ(boots_.take_aged(2 * kSecond), nullptr);
  EXPECT_EQ(boots_.take_aged(2 * kSecond + 100'000), &boot);
  EXPECT_EQ(boots_.take_aged(9 * kSecond), nullptr);  // not watched again
}

TEST_F(BootRegistryTest, WhatWasEnqueuedMeanwhileIsNotOld) {
  connect(10);
  storage::BootEntry& boot = receive(10, 0, 50, kSecond);
  boot.recording.take_segments(true);
  receive(10, 50, 5, 2 * kSecond);
  EXPECT_EQ(boots_.take_aged(3 * kSecond), nullptr);
  EXPECT_EQ(boots_.take_aged(3 * kSecond + 100'000), &boot);
}

TEST_F(BootRegistryTest, WithoutAConnectionASingleSampleIsDue) {
  connect(10);
  storage::BootEntry& boot = receive(10, 0, 1, kSecond);
  EXPECT_EQ(boots_.take_due(), nullptr);
  boot.connected = false;
  boots_.watch(boot);
  EXPECT_EQ(boots_.take_due(), &boot);
}

TEST_F(BootRegistryTest, HolesAreServedInTurnUntilTheyAreClosed) {
  connect(10);
  connect(20, "dory");
  storage::BootEntry& nemo = receive(10, 5, 5, kSecond);
  storage::BootEntry& dory = receive(20, 5, 5, kSecond);
  EXPECT_EQ(boots_.holes(), 2u);
  EXPECT_EQ(boots_.next_with_holes(), &nemo);
  EXPECT_EQ(boots_.next_with_holes(), &dory);
  receive(10, 0, 5, kSecond);
  EXPECT_EQ(boots_.next_with_holes(), nullptr);
  EXPECT_EQ(boots_.holes(), 1u);
  EXPECT_EQ(boots_.next_with_holes(), &dory);
}

TEST_F(BootRegistryTest, ForgetsWhatNobodyUses) {
  admit(hello("nemo", 10));
  boots_.forget_unused(61 * kSecond);
  EXPECT_NE(boots_.find(10), nullptr);  // it is to be stored
  boots_.with_records().take_first();
  boots_.forget_unused(61 * kSecond + 1);
  EXPECT_NE(boots_.find(10), nullptr);  // it was looked for just now
  boots_.forget_unused(80 * kSecond);
  EXPECT_EQ(boots_.find(10), nullptr);
  EXPECT_TRUE(boots_.empty());
}

TEST_F(BootRegistryTest, ForgetsARefusedBootAtOnceUnlessAnotherAdmissionIsUnderWay) {
  boots_.forget_unused(0);
  storage::BootEntry& boot = boots_.enter(10, "nemo");
  boot.admissions = 1;
  boots_.forget_soon();
  boots_.forget_unused(1);
  EXPECT_NE(boots_.find(10), nullptr);
  boot.admissions = 0;
  boots_.forget_soon();
  boots_.forget_unused(2);
  EXPECT_EQ(boots_.find(10), nullptr);
}

TEST_F(BootRegistryTest, KeepsAReplacedBootAsLongAsSomethingOfItIsQueued) {
  connect(10);
  boots_.with_records().take_first();
  connect(11);
  boots_.find(10)->queued_segments = 1;
  boots_.forget_unused(0);
  EXPECT_NE(boots_.find(10), nullptr);
  boots_.find(10)->queued_segments = 0;
  boots_.forget_unused(0);
  EXPECT_EQ(boots_.find(10), nullptr);
  EXPECT_NE(boots_.find(11), nullptr);
}

}  // namespace
}  // namespace server
