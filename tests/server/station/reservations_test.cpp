// The reservations that are not over: what may be made, whom a slot keeps out, and in which moment it begins and ends.
#include "server/station/commands/reservations.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace server {
namespace {

using namespace std::chrono_literals;
using station::Reservation;

constexpr std::int64_t kNow = 1'795'000'000'000'000;
constexpr std::int64_t kHour = 3'600'000'000;

class ReservationsTest : public ::testing::Test {
 protected:
  static Reservation slot(std::int64_t from_us, std::int64_t until_us, const char* holder = "user:anna") {
    Reservation one;
    one.robot_id = "r1";
    one.holder = holder;
    one.from_us = from_us;
    one.until_us = until_us;
    return one;
  }
  void add(Reservation one) {
    ASSERT_TRUE(reservations_.check(one, kNow)) << reservations_.check(one, kNow).error().detail;
    one.id = ++last_id_;
    reservations_.add(std::move(one));
  }
  std::string refused(const Reservation& one) const {
    const auto checked = reservations_.check(one, kNow);
    return checked ? "" : checked.error().reason;
  }

  station::Reservations reservations_;
  station::ReservationId last_id_ = 0;
};

TEST_F(ReservationsTest, ASlotHasItsFirstMomentAndNotItsLast) {
  add(slot(kNow + kHour, kNow + 2 * kHour));
  const auto out = [this](std::int64_t utc_us) { return reservations_.keeps_out("r1", "user:ben/session:2", utc_us); };
  EXPECT_EQ(out(kNow + kHour - 1), nullptr);
  ASSERT_NE(out(kNow + kHour), nullptr);
  EXPECT_EQ(out(kNow + kHour)->id, 1);
  EXPECT_NE(out(kNow + 2 * kHour - 1), nullptr);
  EXPECT_EQ(out(kNow + 2 * kHour), nullptr);
  EXPECT_EQ(reservations_.keeps_out("r2", "user:ben/session:2", kNow + kHour), nullptr) << "another robot";
  EXPECT_EQ(reservations_.running("r1", kNow + kHour - 1), nullptr);
  EXPECT_EQ(reservations_.running("r1", kNow + kHour)->holder, "user:anna");
  EXPECT_EQ(reservations_.running("r1", kNow + 2 * kHour), nullptr);
}

TEST_F(ReservationsTest, AnAccountIsAllPagesAndTokensOfAUserOrOneTokenOrPage) {
  reservations_.set_account_of([](const std::string& actor) { return actor == "token:annas" ? "user:anna" : actor; });
  add(slot(kNow, kNow + kHour));
  const auto is_out = [this](const char* actor) { return reservations_.keeps_out("r1", actor, kNow) != nullptr; };
  EXPECT_FALSE(is_out("user:anna/session:4"));
  EXPECT_FALSE(is_out("user:anna/session:5"));
  EXPECT_FALSE(is_out("token:annas"));
  EXPECT_TRUE(is_out("user:annabel/session:6"));
  EXPECT_TRUE(is_out("token:ci"));
  EXPECT_TRUE(is_out("session:4"));
  EXPECT_FALSE(is_out("station:experiments")) << "SAFETY: it brings robots to rest";
  add(slot(kNow + kHour, kNow + 2 * kHour, "token:ci"));
  EXPECT_EQ(reservations_.keeps_out("r1", "token:ci", kNow + kHour), nullptr);
  EXPECT_NE(reservations_.keeps_out("r1", "user:anna/session:4", kNow + kHour), nullptr);
}

TEST_F(ReservationsTest, TheFirstSlotOfASpanThatKeepsTheActorOut) {
  add(slot(kNow + 3 * kHour, kNow + 4 * kHour, "user:carl"));
  add(slot(kNow + 1 * kHour, kNow + 2 * kHour, "user:ben"));
  const auto first = [this](const char* actor, std::int64_t until_us) {
    const Reservation* found = reservations_.keeps_out("r1", actor, kNow, until_us);
    return found == nullptr ? "" : found->holder;
  };
  EXPECT_EQ(first("user:anna/session:1", kNow + kHour), "") << "it begins when the span is over";
  EXPECT_EQ(first("user:anna/session:1", kNow + kHour + 1), "user:ben");
  EXPECT_EQ(first("user:ben/session:1", kNow + 4 * kHour), "user:carl");
}

TEST_F(ReservationsTest, SlotsOfOneRobotNeverOverlap) {
  add(slot(kNow + 2 * kHour, kNow + 4 * kHour));
  EXPECT_EQ(refused(slot(kNow + 3 * kHour, kNow + 5 * kHour)), "reserved");
  EXPECT_EQ(refused(slot(kNow + kHour, kNow + 2 * kHour + 1)), "reserved");
  EXPECT_EQ(refused(slot(kNow + kHour, kNow + 5 * kHour)), "reserved");
  EXPECT_EQ(refused(slot(kNow + 2 * kHour, kNow + 4 * kHour, "user:ben")), "reserved");
  const auto checked = reservations_.check(slot(kNow + 3 * kHour, kNow + 5 * kHour), kNow);
  EXPECT_NE(checked.error().detail.find("user:anna"), std::string::npos);
  EXPECT_NE(checked.error().detail.find(station::utc_text(kNow + 4 * kHour)), std::string::npos);
  EXPECT_EQ(checked.error().code, ErrorCode::conflict);
  add(slot(kNow + kHour, kNow + 2 * kHour));
  add(slot(kNow + 4 * kHour, kNow + 5 * kHour));
  Reservation other = slot(kNow + 2 * kHour, kNow + 4 * kHour);
  other.robot_id = "r2";
  EXPECT_EQ(refused(other), "");
}

TEST_F(ReservationsTest, TimesAreBounded) {
  const std::int64_t week = station::kLongestReservation.count(), year = station::kFurthestReservation.count();
  EXPECT_EQ(refused(slot(kNow, kNow + week)), "");
  EXPECT_EQ(refused(slot(kNow, kNow + week + 1)), "out_of_range") << "too long";
  EXPECT_EQ(refused(slot(kNow + year - kHour, kNow + year)), "");
  EXPECT_EQ(refused(slot(kNow + year - kHour, kNow + year + 1)), "out_of_range") << "too far ahead";
  EXPECT_EQ(refused(slot(kNow + kHour, kNow + kHour)), "out_of_range") << "empty";
  EXPECT_EQ(refused(slot(kNow + 2 * kHour, kNow + kHour)), "out_of_range");
  EXPECT_EQ(refused(slot(kNow - kHour, kNow)), "out_of_range") << "over";
  EXPECT_EQ(refused(slot(kNow - kHour, kNow + 1)), "");
  constexpr std::int64_t kLowest = std::numeric_limits<std::int64_t>::min();
  constexpr std::int64_t kHighest = std::numeric_limits<std::int64_t>::max();
  for (const auto& [from_us, until_us] :
       {std::pair{kLowest, kHighest}, {kHighest, kLowest}, {kNow, kHighest}, {std::int64_t{0}, kNow + 1}}) {
    EXPECT_EQ(refused(slot(from_us, until_us)), "out_of_range");
  }
}

TEST_F(ReservationsTest, AreSoManyAtMost) {
  for (std::size_t i = 0; i < station::kMostReservations; ++i) {
    const auto from_us = kNow + static_cast<std::int64_t>(i) * 1000;
    add(slot(from_us, from_us + 1000));
  }
  const std::int64_t behind_us = kNow + kHour;
  EXPECT_EQ(refused(slot(behind_us, behind_us + kHour)), "too_many_reservations");
  EXPECT_TRUE(reservations_.check(slot(behind_us, behind_us + kHour), kNow + 1000)) << "one is over";
  reservations_.remove(7);
  EXPECT_EQ(refused(slot(behind_us, behind_us + kHour)), "");
}

TEST_F(ReservationsTest, OneThatIsRemovedOrOverIsForgotten) {
  add(slot(kNow, kNow + kHour));
  add(slot(kNow + kHour, kNow + 2 * kHour));
  reservations_.forget_over(kNow + kHour - 1);
  EXPECT_NE(reservations_.find(1), nullptr);
  reservations_.forget_over(kNow + kHour);
  EXPECT_EQ(reservations_.find(1), nullptr);
  ASSERT_NE(reservations_.find(2), nullptr);
  reservations_.remove(2);
  EXPECT_EQ(reservations_.find(2), nullptr);
  EXPECT_EQ(reservations_.keeps_out("r1", "user:ben/session:2", kNow + kHour), nullptr);
}

}  // namespace
}  // namespace server
