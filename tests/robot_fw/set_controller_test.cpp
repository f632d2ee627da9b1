// set_controller and restore_controller in every state, and what the robot says about them.
#include <cmath>

#include "tests/robot_fw/controllers.hpp"
#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

class SetController : public DrivenRobot {
 protected:
  SetController() { station.controllers.clear(); }  // what it said after the Welcome

  std::string set(const protocol::Controller& controller) { return answer(set_controller(controller)); }
  std::uint32_t checksum() {
    station.disconnect();
    station.connect();
    return station.hello->controller_checksum;
  }
};

TEST_F(SetController, AtRestIsInForceAtOnceAndReadBack) {
  EXPECT_EQ(set(biquad_controller()), "accepted");
  ASSERT_EQ(station.controllers.size(), 1u);
  EXPECT_EQ(station.controllers[0].controller_id, 2u);
  EXPECT_EQ(station.controllers[0].checksum, biquad_controller().checksum);
  EXPECT_EQ(checksum_of(station.controllers[0]), biquad_controller().checksum);
  EXPECT_EQ(last().controller_id, 2u);
  EXPECT_EQ(checksum(), biquad_controller().checksum);
  EXPECT_EQ(station.hello->controller_id, 2u);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_CONTROLLER_CHANGED), 1);
  EXPECT_EQ(station.events.back().value, 2);
  EXPECT_NE(station.events.back().command_id, 0u);
}

TEST_F(SetController, FromTheFirstHelloTheBuiltInOneHasItsChecksum) {
  protocol::Controller built_in;
  write_controller(adapted(kPaperController, {-1, 1}, 10'000), 10'000, built_in);
  EXPECT_EQ(station.hello->controller_checksum, checksum_of(built_in));
  EXPECT_EQ(station.hello->controller_id, 1u);
}

TEST_F(SetController, ARefusedOneChangesNothing) {
  const auto before = checksum();
  station.run(2);
  station.controllers.clear();
  auto broken = biquad_controller();
  broken.kp = 31;
  EXPECT_EQ(set(broken), "checksum");
  broken.pole[0] = 1;
  EXPECT_EQ(set(with_checksum(broken)), "unstable");
  broken.duty_max = 2;
  EXPECT_EQ(set(with_checksum(broken)), "out_of_range");
  broken.direct = NAN;
  EXPECT_EQ(set(with_checksum(broken)), "not_finite");
  broken.biquad_a1_count = 0;
  EXPECT_EQ(set(with_checksum(broken)), "malformed");
  EXPECT_TRUE(station.controllers.empty());
  EXPECT_EQ(checksum(), before);
  EXPECT_EQ(answer(restore_controller()), "wrong_mode");
}

TEST_F(SetController, InAutoTheOldOneDrivesOnAndThenTheDutyPasses) {
  SimulatedRobot other{with_boot_id({})};
  StationPeer undisturbed{other};
  undisturbed.connect();
  undisturbed.run(2);
  for (StationPeer* each : {&station, &undisturbed}) {
    each->send(set_auto(0.1F));
    each->run(150);
  }
  EXPECT_EQ(set(scaled_controller(7, 0.5F)), "accepted");
  undisturbed.step();
  EXPECT_TRUE(station.controllers.empty());
  for (int i = 1; i < 100; ++i) {
    station.step();
    undisturbed.step();
    ASSERT_EQ(core().duty(), other.core().duty()) << i;
    ASSERT_EQ(last().controller_id, 1u);
  }
  station.step();
  EXPECT_EQ(last().controller_id, 7u);
  ASSERT_EQ(station.controllers.size(), 1u);
  EXPECT_EQ(station.controllers[0].controller_id, 7u);
  station.run(10);
  EXPECT_EQ(set(scaled_controller(8, 0.7F)), "busy");
  station.run(10);
  EXPECT_EQ(set(scaled_controller(8, 0.7F)), "accepted");
  EXPECT_EQ(mode(), "auto");
}

TEST_F(SetController, AChangeOfModeEndsTheChange) {
  order(set_auto(0.1F));
  set(scaled_controller(7, 0.5F));
  station.run(10);
  EXPECT_EQ(last().controller_id, 1u);
  order(set_manual());
  EXPECT_EQ(last().controller_id, 7u);
  EXPECT_EQ(station.controllers.size(), 1u);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_CONTROLLER_CHANGED), 1);
}

TEST_F(SetController, IsRefusedInEmergency) {
  order(emergency_stop());
  EXPECT_EQ(set(biquad_controller()), "latched");
  EXPECT_EQ(answer(restore_controller()), "latched");
}

TEST_F(SetController, RestoreBringsBackTheOneBefore) {
  const auto before = checksum();
  set(biquad_controller());
  EXPECT_EQ(answer(restore_controller()), "accepted");
  EXPECT_EQ(last().controller_id, 1u);
  EXPECT_EQ(checksum(), before);
  EXPECT_EQ(station.controllers.size(), 2u);
  EXPECT_EQ(answer(restore_controller()), "accepted");
  EXPECT_EQ(last().controller_id, 2u);
}

TEST_F(SetController, KeepsItsOwnDutyLimits) {
  auto gentle = paper_controller();
  gentle.controller_id = 9;
  gentle.duty_min = -0.2F;
  gentle.duty_max = 0.3F;
  set(with_checksum(gentle));
  order(set_auto(0.2F));
  EXPECT_NE(last().flags & rheonaut_TELEMETRY_FLAG_SATURATED, 0u);
  station.run(1500);
  for (const auto& [seq, sample] : station.samples) {
    ASSERT_LE(sample.duty, 0.3F);
    ASSERT_GE(sample.duty, -0.2F);
  }
  EXPECT_NEAR(last().position_m, 0.2F, 2e-3F);
}

TEST(OneWayMotorController, IsAdaptedAndRefusesOneWithReverse) {
  SimulatedRobotConfig config;
  config.duty = {0, 1};
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.connect();
  const auto id = station.send(set_controller(paper_controller()));
  station.run(2);
  EXPECT_EQ(station.ack_of(id)->reason, rheonaut_REJECT_REASON_OUT_OF_RANGE);
}

// Another built-in one in place of the paper's: a change, and the way back to it, are as with any motor.
TEST(OneWayMotorController, IsTheBuiltInOneAndTheWayBackLeadsToIt) {
  SimulatedRobotConfig config;
  config.duty = {0, 1};
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.connect();
  station.run(6);
  protocol::Controller built_in;
  write_controller(adapted(kOneWayController, {0, 1}, 10'000), 10'000, built_in);
  EXPECT_EQ(station.hello->controller_id, kOneWayController.controller_id);
  EXPECT_EQ(station.hello->controller_checksum, checksum_of(built_in));
  EXPECT_EQ(built_in.duty_min, 0);
  protocol::Controller other = scaled_controller(7, 0.5F);
  other.duty_min = 0;
  station.send(set_controller(with_checksum(other)));
  station.run(6);
  EXPECT_EQ(station.samples.rbegin()->second.controller_id, 7u);
  station.send(restore_controller());
  station.run(6);
  EXPECT_EQ(station.samples.rbegin()->second.controller_id, kOneWayController.controller_id);
  ASSERT_FALSE(station.controllers.empty());
  EXPECT_EQ(station.controllers.back().checksum, checksum_of(built_in));
  EXPECT_EQ(station.controllers.back().kp, kOneWayController.kp);
}

}  // namespace
}  // namespace robot_fw
