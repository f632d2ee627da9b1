// Which Hello is refused and with which words, and what a Welcome says.
#include "server/link/greeting.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "server/station/state/checked.hpp"

namespace server {
namespace {

protocol::Hello hello() {
  protocol::Hello hello = rheonaut_Hello_init_zero;
  hello.protocol_version = protocol::kProtocolVersion;
  std::strcpy(hello.robot_id, "r1");
  hello.boot_id = 7;
  hello.sample_period_us = 10'000;
  hello.oldest_seq = 10;
  hello.next_seq = 20;
  return hello;
}

protocol::RefusalReason reason_for(const protocol::Hello& hello, std::uint64_t robot_time_us = 0) {
  const auto refusal = link::refusal_of(hello, robot_time_us);
  return refusal ? refusal->reason : rheonaut_REFUSAL_REASON_NONE;
}

TEST(Greeting, AHelloThatCanBeIsNotRefused) {
  EXPECT_EQ(reason_for(hello()), rheonaut_REFUSAL_REASON_NONE);
  EXPECT_EQ(reason_for(hello(), station::kMaxRobotNumber), rheonaut_REFUSAL_REASON_NONE);
}

TEST(Greeting, AnotherVersionIsRefusedBeforeAnythingElse) {
  auto other = hello();
  other.protocol_version += 1;
  other.boot_id = 0;
  const auto refusal = link::refusal_of(other, 0);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->reason, rheonaut_REFUSAL_REASON_VERSION);
  const auto number = std::to_string(other.protocol_version);
  EXPECT_TRUE(refusal->detail.ends_with(", the robot " + number)) << refusal->detail;
}

TEST(Greeting, NumbersThatCannotBeAreMalformed) {
  for (const auto field : {&protocol::Hello::oldest_seq, &protocol::Hello::oldest_event_seq, &protocol::Hello::next_seq,
                           &protocol::Hello::next_event_seq}) {
    auto bad = hello();
    bad.*field = station::kMaxRobotNumber + 1;
    EXPECT_EQ(reason_for(bad), rheonaut_REFUSAL_REASON_MALFORMED);
  }
  for (const auto oldest : {&protocol::Hello::oldest_seq, &protocol::Hello::oldest_event_seq}) {
    auto crossed = hello();
    crossed.*oldest = 21;
    EXPECT_EQ(reason_for(crossed), rheonaut_REFUSAL_REASON_MALFORMED) << "it holds what it has not made";
  }
  auto without_boot = hello();
  without_boot.boot_id = 0;
  EXPECT_EQ(reason_for(without_boot), rheonaut_REFUSAL_REASON_MALFORMED);
  EXPECT_EQ(reason_for(hello(), station::kMaxRobotNumber + 1), rheonaut_REFUSAL_REASON_MALFORMED);
}

TEST(Greeting, APeriodThatCannotBeIsMalformedAndSaysWhatToSend) {
  for (const std::uint32_t period_us : {1U, 10'000U, 10'000'000U}) {
    auto good = hello();
    good.sample_period_us = period_us;
    EXPECT_EQ(reason_for(good), rheonaut_REFUSAL_REASON_NONE) << period_us;
  }
  for (const std::uint32_t period_us : {0U, 10'000'001U, 0xFFFFFFFFU}) {
    auto bad = hello();
    bad.sample_period_us = period_us;
    const auto refusal = link::refusal_of(bad, 0);
    ASSERT_TRUE(refusal) << period_us;
    EXPECT_EQ(refusal->reason, rheonaut_REFUSAL_REASON_MALFORMED);
    EXPECT_EQ(refusal->detail, "sample_period_us is " + std::to_string(period_us) +
                                   "; send the time from sample to sample in µs, 1 to 10000000");
    EXPECT_LT(refusal->detail.size(), sizeof rheonaut_Welcome::detail);
  }
}

TEST(Greeting, AHelloIsFoundInAFrameWhateverItSays) {
  const auto has_hello = [](std::vector<std::uint8_t> bytes) { return link::has_hello({bytes.data(), bytes.size()}); };
  EXPECT_TRUE(has_hello({0x08, 1, 0x12, 2, 0xFF, 0xFF})) << "robot_time_us 1, then a hello";
  EXPECT_FALSE(has_hello({})) << "nothing";
  EXPECT_FALSE(has_hello({0x08, 1, 0x1A, 0})) << "a heartbeat";
  EXPECT_FALSE(has_hello({0x10, 1})) << "a number under its tag";
  EXPECT_FALSE(has_hello({'G', 'E', 'T', ' ', '/'})) << "another protocol";
  EXPECT_FALSE(has_hello({0x1A, 9, 0x12, 0})) << "a body that ends before its length";
}

TEST(Greeting, NamesHaveTheirCharacters) {
  for (const char* name : {"", "R1", "r 1", "r/1"}) {
    auto bad = hello();
    std::strcpy(bad.robot_id, name);
    EXPECT_EQ(reason_for(bad), rheonaut_REFUSAL_REASON_MALFORMED) << name;
  }
}

TEST(Greeting, TheArchiveIsAskedWithWhatTheRobotSays) {
  auto said = hello();
  std::strcpy(said.token, "secret");
  said.acknowledged_next_seq = 15;
  const station::AdmissionRequest request = link::admission_request(said, 1'000, true, 2'000);
  EXPECT_EQ(request.robot_id, "r1");
  EXPECT_EQ(request.token, "secret");
  EXPECT_TRUE(request.from_loopback);
  EXPECT_EQ(request.boot_id, 7U);
  EXPECT_EQ(request.oldest_seq, 10U);
  EXPECT_EQ(request.next_seq, 20U);
  EXPECT_EQ(request.acknowledged_next_seq, 15U);
  EXPECT_EQ(request.robot_time_us, 1'000U);
  EXPECT_EQ(request.received_at_us, 2'000);
}

TEST(Greeting, AWelcomeSaysWhatIsDurableAndTheTimes) {
  station::Admission admission;
  admission.store_id = 3;
  admission.durable_next_seq = 17;
  admission.durable_next_event_seq = 2;
  EXPECT_FALSE(link::refusal_of(admission));
  const protocol::Welcome welcome = link::welcome_of(admission, config::LinkTimes{1'500, 300, 10}, 99);
  EXPECT_EQ(welcome.protocol_version, protocol::kProtocolVersion);
  EXPECT_EQ(welcome.refusal, rheonaut_REFUSAL_REASON_NONE);
  EXPECT_EQ(welcome.store_id, 3U);
  EXPECT_EQ(welcome.durable_next_seq, 17U);
  EXPECT_EQ(welcome.durable_next_event_seq, 2U);
  EXPECT_EQ(welcome.link_timeout_ms, 1'500U);
  EXPECT_EQ(welcome.heartbeat_interval_ms, 300U);
  EXPECT_EQ(welcome.samples_per_frame, 10U);
  EXPECT_EQ(welcome.utc_us, 99);
}

TEST(Greeting, ARefusalOfTheArchiveIsCutToItsRoom) {
  station::Admission admission;
  admission.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  admission.detail = std::string(500, 'x');
  const auto refusal = link::refusal_of(admission);
  ASSERT_TRUE(refusal);
  const protocol::Welcome welcome = welcome_of(*refusal);
  EXPECT_EQ(welcome.refusal, rheonaut_REFUSAL_REASON_WRONG_TOKEN);
  EXPECT_EQ(std::strlen(welcome.detail), sizeof welcome.detail - 1);
}

TEST(Greeting, WhatARobotIsToldEndsAfterAWholeWord) {
  const auto told = [](const std::string& detail) {
    return std::string{welcome_of(link::Refusal{rheonaut_REFUSAL_REASON_WRONG_TOKEN, detail}).detail};
  };
  const std::string fits(sizeof rheonaut_Welcome::detail - 1, 'x');
  EXPECT_EQ(told(fits), fits);
  const std::string boot = "17680386226788228036";
  for (std::size_t before = 90; before < 127; ++before) {
    const std::string begins = std::string(before - 6, 'x') + " boot";
    const std::string said = told(begins + " " + boot + " of another robot, which goes on for much longer than it may");
    EXPECT_TRUE(said.ends_with(" ...")) << said;
    EXPECT_TRUE(said.find(boot) != std::string::npos || said.find('1') == std::string::npos) << said;
  }
  std::string micro;
  for (int i = 0; i < 100; ++i) micro += "µ";  // two bytes each
  for (const std::string& text : {micro, "x" + micro}) {
    const std::string said = told(text);
    EXPECT_TRUE(said.ends_with("µ ...")) << said;
  }
}

}  // namespace
}  // namespace server
