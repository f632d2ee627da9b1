// What is said of commits that fail: why, when they are tried again, and not in every second of a long failure.
#include "server/storage/ingest/write_failure.hpp"

#include <gtest/gtest.h>

#include "tests/server/captured_log.hpp"

namespace server {
namespace {

constexpr std::int64_t kSecondUs = 1'000'000;
constexpr std::int64_t kBeginUs = 5 * kSecondUs;

class WriteFailureTest : public ::testing::Test {
 protected:
  void fail(std::int64_t now_us) { failure_.on_failed("disk full", "station.sqlite", now_us); }
  std::size_t errors() const { return log_.lines_with("cannot be written: disk full"); }

  CapturedLog log_;
  storage::WriteFailure failure_;
};

TEST_F(WriteFailureTest, AFailedCommitIsTriedAgainAfterASecond) {
  EXPECT_FALSE(failure_.is_failing());
  fail(kBeginUs);
  EXPECT_TRUE(failure_.is_failing());
  EXPECT_EQ(failure_.retry_at_us(), kBeginUs + kSecondUs);
  EXPECT_EQ(failure_.problem(), "disk full");
  fail(kBeginUs + kSecondUs);
  EXPECT_EQ(failure_.retry_at_us(), kBeginUs + 2 * kSecondUs);
}

TEST_F(WriteFailureTest, ALongFailureIsLoggedEachTenSeconds) {
  for (int second = 0; second < 10; ++second) fail(kBeginUs + second * kSecondUs);
  EXPECT_EQ(errors(), 1U);
  EXPECT_TRUE(log_.has("station.sqlite"));
  for (int second = 10; second < 20; ++second) fail(kBeginUs + second * kSecondUs);
  EXPECT_EQ(errors(), 2U);
}

TEST_F(WriteFailureTest, ACommitThatIsDurableEndsIt) {
  fail(kBeginUs);
  failure_.on_written();
  EXPECT_FALSE(failure_.is_failing());
  EXPECT_EQ(failure_.problem(), "");
  EXPECT_EQ(log_.lines_with("recording goes on"), 1U);
  failure_.on_written();
  EXPECT_EQ(log_.lines_with("recording goes on"), 1U) << "only after a failure";
}

TEST_F(WriteFailureTest, TheNextFailureIsLoggedAtOnce) {
  fail(kBeginUs);
  failure_.on_written();
  fail(kBeginUs + kSecondUs);
  EXPECT_EQ(errors(), 2U);
}

}  // namespace
}  // namespace server
