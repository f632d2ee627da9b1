// Reservations on disk: there before they are answered, over restarts, with their entries in the audit.
#include "server/storage/reservations/reservation_book.hpp"

#include <gmock/gmock.h>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using station::Reservation;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class ReservationBookTest : public RecordingTest {
 protected:
  storage::ReservationBook& book() { return recording_->reservations; }
  Reservation slot(microseconds in, microseconds lasts, const char* robot_id = "nemo") const {
    Reservation one;
    one.robot_id = robot_id;
    one.holder = "user:anna";
    one.from_us = clock_.utc_us() + in.count();
    one.until_us = one.from_us + lasts.count();
    one.purpose = "bed 3";
    return one;
  }
  Result<Reservation> store(const Reservation& one) {
    return wait(book().store(one, {"user:anna/session:4", "10.0.0.7", 0}));
  }
  Result<Reservation> cancel(station::ReservationId id) { return wait(book().cancel(id, {"token:local", "", 0})); }
  std::vector<station::ReservationId> listed(std::optional<bool> is_over, std::optional<std::string> robot_id = {}) {
    storage::ReservationFilter filter;
    filter.is_over = is_over;
    filter.robot_id = std::move(robot_id);
    std::vector<station::ReservationId> ids;
    for (const Reservation& one : wait(book().list(filter))) ids.push_back(one.id);
    return ids;
  }
};

TEST_F(ReservationBookTest, OneThatWasAnsweredIsInForceAfterKill9) {
  start();
  EXPECT_THAT(restored_.reservations, IsEmpty());
  const auto made = store(slot(1h, 2h));
  ASSERT_TRUE(made) << made.error().detail;
  EXPECT_EQ(made->id, 1);
  EXPECT_EQ(made->made_by, "user:anna/session:4");
  EXPECT_GT(made->made_at_us, 0);
  kill();
  start();
  EXPECT_THAT(restored_.reservations, ElementsAre(*made));
  EXPECT_THAT(rows("SELECT action, subject, actor, robot_id FROM audit WHERE action LIKE 'reservation.%'"),
              ElementsAre("reservation.made|1|user:anna/session:4|nemo"));
  stop();
}

TEST_F(ReservationBookTest, ACancelledOneStaysInTheRecordAndIsNotInForceAgain) {
  start();
  ASSERT_TRUE(store(slot(1h, 1h)));
  const auto cancelled = cancel(1);
  ASSERT_TRUE(cancelled);
  EXPECT_EQ(cancelled->cancelled_by, "token:local");
  EXPECT_GT(cancelled->cancelled_at_us, 0);
  EXPECT_EQ(cancel(1).error().reason, "wrong_state");
  EXPECT_EQ(cancel(2).error().reason, "no_such_reservation");
  ASSERT_TRUE(store(slot(1h, 1h))) << "its slot is free again";
  kill();
  start();
  ASSERT_EQ(restored_.reservations.size(), 1U);
  EXPECT_EQ(restored_.reservations[0].id, 2);
  EXPECT_EQ(wait(book().find(1)).value(), *cancelled);
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE action = 'reservation.cancelled' AND subject = '1'"), 1);
  stop();
}

TEST_F(ReservationBookTest, TheDatabaseHasNoTwoOfOneRobotThatOverlap) {
  start();
  ASSERT_TRUE(store(slot(1h, 2h)));
  const auto refused = store(slot(2h, 2h));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, "reserved");
  EXPECT_EQ(refused.error().code, ErrorCode::conflict);
  EXPECT_TRUE(store(slot(2h, 2h, "dory")));
  EXPECT_TRUE(store(slot(3h, 1h)));
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE action = 'reservation.made'"), 3);
  stop();
}

TEST_F(ReservationBookTest, ListsTheNewestFirstByRobotAndByWhetherTheyAreOver) {
  start();
  ASSERT_TRUE(store(slot(0h, 1h)));
  ASSERT_TRUE(store(slot(2h, 1h)));
  ASSERT_TRUE(store(slot(2h, 1h, "dory")));
  ASSERT_TRUE(cancel(2));
  clock_.run_for(1h);
  EXPECT_THAT(listed({}), ElementsAre(3, 2, 1));
  EXPECT_THAT(listed(false), ElementsAre(3));
  EXPECT_THAT(listed(true), ElementsAre(2, 1));
  EXPECT_THAT(listed({}, "dory"), ElementsAre(3));
  EXPECT_EQ(cancel(1).error().reason, "wrong_state") << "it is over";
  storage::ReservationFilter before;
  before.before = 3;
  before.limit = 1;
  EXPECT_EQ(wait(book().list(before)).at(0).id, 2);
  stop();
  start();
  EXPECT_EQ(restored_.reservations.size(), 2U) << "not the cancelled one; one has been over for less than a day";
  stop();
}

}  // namespace
}  // namespace server
