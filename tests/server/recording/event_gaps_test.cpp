// What is stored of events that were too many: how many, exactly. The robot may forget them.
#include "tests/server/recording/recorder_fixture.hpp"

namespace server {
namespace {

class EventGapsTest : public RecorderFixture {
 protected:
  void leave_out(std::uint64_t event_seq) {
    recorder_->on_event_left_out(state_of(robot_, station::LinkState::connected), event_seq);
  }
};

TEST_F(EventGapsTest, AFloodIsAFewRowsThatCountItExactly) {
  start();
  connect(robot_);
  constexpr std::uint64_t kEvents = 40'000;
  for (std::uint64_t seq = 0; seq < kEvents; ++seq) {
    const bool is_kept = seq < 1000 || seq % 400 == 0;  // as of 400 in 20 ms
    is_kept ? send_event(robot_, seq) : leave_out(seq);
    if (seq % 400 == 399) clock_.run_for(20ms);
  }
  wait(recorder_->flush_records());
  const std::int64_t kept = number("SELECT count(*) FROM event WHERE event_seq IS NOT NULL");
  EXPECT_EQ(kept, 1097);
  EXPECT_EQ(number("SELECT sum(last_event_seq - first_event_seq + 1) FROM event_gap WHERE cause = 'too_many'"),
            static_cast<std::int64_t>(kEvents) - kept);
  EXPECT_LE(number("SELECT count(*) FROM event_gap"), 150);
  clock_.run_for(3s);
  EXPECT_EQ(durable_next_event_seq_, kEvents) << "the robot may forget them";
  EXPECT_EQ(missing_events_, 0) << "nobody asks for them";
}

TEST_F(EventGapsTest, OneThatIsStoredAlreadyIsNotLost) {
  start();
  connect(robot_);
  send_event(robot_, 0);
  leave_out(0);
  wait(recorder_->flush_records());
  EXPECT_EQ(number("SELECT count(*) FROM event WHERE event_seq = 0"), 1);
  EXPECT_EQ(number("SELECT count(*) FROM event_gap"), 0);
}

}  // namespace
}  // namespace server
