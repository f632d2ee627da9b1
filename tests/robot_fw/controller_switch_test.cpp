// The way from one controller to the next: warm-up, cross-fade, and back.
#include "robot_fw/core/controller_switch.hpp"

#include <gtest/gtest.h>

namespace robot_fw {
namespace {

// A plain gain: the duty for an error of 1 shows which controller drives.
ControllerSections gain(std::uint32_t id, float kp) {
  ControllerSections sections;
  sections.controller_id = id;
  sections.kp = kp;
  return sections;
}

class Switch : public ::testing::Test {
 protected:
  float step() { return controllers.step(1, 0).limited; }
  void run(std::uint32_t ticks) {
    for (std::uint32_t i = 0; i < ticks; ++i) step();
  }
  std::uint32_t id() const { return controllers.in_force().controller_id; }

  ControllerSwitch controllers{gain(1, 0.2F)};
};

TEST_F(Switch, AtRestTheNewOneIsInForceAtOnce) {
  EXPECT_TRUE(controllers.set(gain(2, 0.4F), false));
  EXPECT_EQ(id(), 2u);
  EXPECT_TRUE(controllers.take_news());
  EXPECT_FALSE(controllers.take_news());
  EXPECT_EQ(step(), 0.4F);
}

TEST_F(Switch, InMotionTheOldOneDrivesFor1sAndTheDutyPassesOver200ms) {
  controllers.set(gain(2, 0.4F), true);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(step(), 0.2F);
  EXPECT_EQ(id(), 1u);
  EXPECT_FALSE(controllers.take_news());
  for (int i = 1; i <= 20; ++i) {
    EXPECT_NEAR(step(), 0.2F + 0.01F * static_cast<float>(i), 1e-6F);
    EXPECT_EQ(id(), 2u);
  }
  EXPECT_TRUE(controllers.take_news());
  EXPECT_EQ(step(), 0.4F);
}

TEST_F(Switch, TheNewOneHasSeenTheErrorWhenItComesIn) {
  controllers.set(kPaperController, true);
  Controller alone{kPaperController};
  for (int i = 0; i < 120; ++i) {
    controllers.step(0.01F, 0);
    alone.step(0.01F, 0);
  }
  EXPECT_EQ(controllers.step(0.012F, 0).asked, alone.step(0.012F, 0).asked);
}

TEST_F(Switch, EachKeepsItsOwnLimitsDuringTheCrossFade) {
  ControllerSections narrow = gain(2, 100);
  narrow.duty_max = 0.3F;
  controllers.set(narrow, true);
  run(100);
  for (int i = 0; i < 30; ++i) EXPECT_LE(step(), 0.3F);
}

TEST_F(Switch, AnotherOneReplacesTheOneThatWarmsUp) {
  controllers.set(gain(2, 0.4F), true);
  run(60);
  EXPECT_TRUE(controllers.set(gain(3, 0.6F), true));
  run(100);
  EXPECT_EQ(id(), 1u);
  run(20);
  EXPECT_EQ(step(), 0.6F);
  EXPECT_TRUE(controllers.restore(false));
  EXPECT_EQ(id(), 1u);  // the second never was in force
}

TEST_F(Switch, TakesNoneDuringTheCrossFade) {
  controllers.set(gain(2, 0.4F), true);
  run(101);
  EXPECT_FALSE(controllers.set(gain(3, 0.6F), true));
  run(19);
  EXPECT_TRUE(controllers.set(gain(3, 0.6F), true));
}

TEST_F(Switch, RestoreWithoutAnEarlierOneIsRefused) {
  EXPECT_FALSE(controllers.restore(false));
  EXPECT_FALSE(controllers.restore(true));
  EXPECT_EQ(step(), 0.2F);
}

TEST_F(Switch, RestoreGoesBackAndForth) {
  controllers.set(gain(2, 0.4F), false);
  controllers.restore(false);
  EXPECT_EQ(step(), 0.2F);
  controllers.restore(true);
  run(100);
  EXPECT_EQ(id(), 1u);
  run(20);
  EXPECT_EQ(step(), 0.4F);
}

TEST_F(Switch, RestoreDuringTheWarmUpLeavesTheOldOneDriving) {
  controllers.set(gain(2, 0.4F), true);
  run(50);
  EXPECT_TRUE(controllers.restore(true));
  EXPECT_TRUE(controllers.take_news());
  for (int i = 0; i < 200; ++i) EXPECT_EQ(step(), 0.2F);
}

TEST_F(Switch, RestoreDuringTheCrossFadeTurnsBackWithoutAJump) {
  controllers.set(gain(2, 0.4F), true);
  run(105);  // a quarter of the way: 0.25
  controllers.restore(true);
  EXPECT_EQ(id(), 1u);
  for (int i = 1; i <= 5; ++i) EXPECT_NEAR(step(), 0.25F - 0.01F * static_cast<float>(i), 1e-6F);
  EXPECT_EQ(step(), 0.2F);
}

TEST_F(Switch, AResetEndsTheChange) {
  controllers.set(gain(2, 0.4F), true);
  run(10);
  controllers.reset();
  EXPECT_EQ(id(), 2u);
  EXPECT_TRUE(controllers.take_news());
  EXPECT_EQ(step(), 0.4F);
}

}  // namespace
}  // namespace robot_fw
