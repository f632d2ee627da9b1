// A boot_id that was used before: by another robot, or by this one in a boot that lies before what is stored of it.
#include "tests/server/recording/recorder_fixture.hpp"

namespace server {
namespace {

class ReusedBootTest : public RecorderFixture {};

TEST_F(ReusedBootTest, RefusesABootIdOfAnotherRobot) {
  start();
  connect(robot_);
  TestRobot other;
  other.id = "dory";
  EXPECT_EQ(admit(other).refusal, rheonaut_REFUSAL_REASON_BOOT_ID_REUSED);
  EXPECT_EQ(number("SELECT count(*) FROM robot"), 1);  // and does not enrol its bearer
}

TEST_F(ReusedBootTest, RefusesABootThatLiesBeforeWhatIsStored) {
  for (const bool restarted : {false, true}) {
    SCOPED_TRACE(restarted);
    std::filesystem::remove(path_);
    TestRobot robot;
    start();
    connect(robot);
    make(robot, 20);
    flush();
    if (restarted) {
      kill();
      start();
    }
    TestRobot earlier = robot;
    earlier.next_seq = 19;
    EXPECT_EQ(admit(earlier).refusal, rheonaut_REFUSAL_REASON_BOOT_ID_REUSED);
    EXPECT_EQ(admit(robot).refusal, rheonaut_REFUSAL_REASON_NONE);
    kill();
  }
}

TEST_F(ReusedBootTest, ASampleThatIsAheadOfItsRobotsClockKeepsTheRobotNotOut) {
  start();
  connect(robot_);
  make(robot_, 20);
  station::SampleBatch ahead = robot_.batch(20, 5);
  ahead.first_robot_time_us += 60'000'000;
  robot_.next_seq = 25;
  recorder_->on_samples(state_of(robot_, station::LinkState::connected), ahead);
  flush();
  EXPECT_EQ(samples(), 25);
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_NONE);
  kill();
  start();
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_NONE) << "also of what is stored";
}

}  // namespace
}  // namespace server
