// The fluid that a robot is in: who may name it, what limits it brings, and what a restart makes of it.
#include <gmock/gmock.h>

#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class FluidTest : public LinkTest {
 protected:
  Result<void> set(const std::string& fluid, const std::string& actor = "token:local") {
    return station.set_fluid("r1", fluid, {actor, "10.0.0.7", clock.utc_us()});
  }
  std::string fluid() const { return station.find("r1")->fluid; }
};

TEST_F(FluidTest, ItIsNamedForARobotAndStaysWhenTheRobotGoes) {
  auto* robot = connect();
  EXPECT_EQ(fluid(), "");
  EXPECT_TRUE(set("water"));
  EXPECT_EQ(fluid(), "water");
  EXPECT_EQ(sink.robots.back().fluid, "water");
  EXPECT_EQ(sink.events.back().kind, "fluid_set");
  EXPECT_EQ(sink.events.back().detail, "water by token:local");
  robot->link.cut();
  clock.run_for(2s);
  ASSERT_FALSE(connected());
  EXPECT_EQ(fluid(), "water");
  EXPECT_TRUE(set("non_newtonian")) << "it need not be connected";
  EXPECT_TRUE(set("")) << "not known any more";
  EXPECT_EQ(fluid(), "");
}

TEST_F(FluidTest, WhatIsNotListedIsRefusedAndChangesNothing) {
  connect();
  ASSERT_TRUE(set("water"));
  EXPECT_EQ(set("watr").error().reason, "unknown_fluid");
  EXPECT_EQ(station.set_fluid("r2", "water", {}).error().reason, "unknown_robot");
  EXPECT_EQ(fluid(), "water");
}

TEST_F(FluidTest, WhileSomebodyIsInControlNobodyElseChangesTheLimitsThatTheyCommandUnder) {
  connect();
  ASSERT_TRUE(set("water", "session:2"));
  ASSERT_TRUE(station.control({"r1", "session:1", "", station::ControlAction::take, station::kControlLease, ""}));
  const auto refused = set("non_newtonian", "session:2");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, "not_in_control");
  EXPECT_THAT(refused.error().detail, HasSubstr("only who is in control changes the fluid"));
  EXPECT_EQ(fluid(), "water");
  EXPECT_TRUE(set("water", "session:2")) << "no change";
  EXPECT_TRUE(set("non_newtonian", "session:1"));
}

TEST_F(FluidTest, AfterARestartOnlyAFluidThatIsStillListedIsKnown) {
  station.restore({{.id = "r1", .fluid = "water"}, {.id = "r2", .fluid = "glycerine"}}, {});
  EXPECT_EQ(fluid(), "water");
  EXPECT_EQ(station.find("r2")->fluid, "");
}

}  // namespace
}  // namespace server
