// The model of a fluid, from the station's list into the estimator of a simulated robot.
#include <bit>

#include "robot_fw/core/parameters.hpp"
#include "server/station/state/fluid_model.hpp"
#include "tests/system/station_fixture.hpp"

namespace server {
namespace {

constexpr std::uint32_t kFlagConfirmed = rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED;

class ModelTest : public SystemTest {
 protected:
  ModelTest() {
    station::FluidModel model;
    model.gain_m_s = {0.1F, 0.2F / 3, -0.05F, 0.01F};
    model.time_constant_s = {0.1F, 1.0F / 3, 3, 12};
    model.fit_error = 0.001;
    model_ = wait_for(recording->fluid_models.set("water", model, {"token:local", "", 0})).value();
  }

  void name_fluid(const std::string& fluid, const std::string& actor = "token:local") {
    ASSERT_TRUE(station.set_fluid("sim-1", fluid, {actor, "", clock.utc_us()}));
  }
  bool becomes(station::ModelState wanted) {
    return clock.run_until([&] { return state().model.state == wanted; }, 10s);
  }
  bool flag() const { return (state().context.flags & kFlagConfirmed) != 0; }
  // By what the robot says of each, and by the checksum over all of its parameters, which it says when it connects.
  void expect_in_force() {
    robot_fw::Parameters expected;
    expected.set(robot_fw::ParameterId::model_confirmed, 1);
    for (const auto& [name, value] : parameters_of(model_)) {
      const auto in_force = station.settings("sim-1")->parameters.value(name);
      ASSERT_TRUE(in_force);
      EXPECT_EQ(std::bit_cast<std::uint32_t>(*in_force), std::bit_cast<std::uint32_t>(value)) << name;
      expected.set(robot_fw::Parameters::find(name.c_str()).value(), value);
    }
    EXPECT_EQ(state().parameters_checksum, expected.checksum()) << "computed by the station from what was reported";
    const std::int64_t connected_at_us = state().connected_at_us;
    robot->cut();
    ASSERT_TRUE(clock.run_until([&] { return state().connected_at_us != connected_at_us; }, 5s));
    EXPECT_EQ(state().parameters_checksum, expected.checksum());
    pass(1);
    EXPECT_EQ(state().model.state, station::ModelState::confirmed) << "the link alone changes nothing";
    EXPECT_TRUE(flag());
  }

  station::FluidModel model_;
};

TEST_F(ModelTest, AFluidThatIsNamedBringsItsModelAndABootOrAnotherFluidTakesItAway) {
  begin();
  EXPECT_FALSE(flag());
  name_fluid("water");
  ASSERT_TRUE(becomes(station::ModelState::confirmed)) << state().model.reason;
  EXPECT_TRUE(flag());
  expect_in_force();

  const auto before = std::move(robot);  // its tasks end with the test
  before->redial = false;
  before->cut();
  clock.run_for(1s);
  sim_robot::SimulatedRobotConfig next = before->config();
  next.boot_id = before->config().boot_id + 1;
  begin(next);
  ASSERT_TRUE(becomes(station::ModelState::assumed));
  pass(5);
  EXPECT_FALSE(flag());

  name_fluid("water");
  ASSERT_TRUE(becomes(station::ModelState::confirmed)) << state().model.reason;
  name_fluid("non_newtonian");
  ASSERT_TRUE(becomes(station::ModelState::assumed)) << state().model.reason;
  pass(0.2);
  EXPECT_FALSE(flag());
}

TEST_F(ModelTest, ARunThatNamesTheFluidBringsItsModel) {
  begin();
  storage::RunConditions conditions;
  conditions.name = "in water";
  conditions.fluid = "water";
  ASSERT_TRUE(wait_for(runs->create("sim-1", conditions, {"token:local", "", 0})));
  ASSERT_TRUE(becomes(station::ModelState::confirmed)) << state().model.reason;
  expect_in_force();
}

TEST_F(ModelTest, ARobotThatDrivesIsSentTheModelWhenItRests) {
  begin();
  send(sim_robot::set_auto(0.02F)).expect_accepted();
  pass(1);
  name_fluid("water", "test");
  pass(2);
  EXPECT_EQ(state().model.state, station::ModelState::sending);
  EXPECT_FALSE(flag());
  send(sim_robot::set_manual()).expect_accepted();
  ASSERT_TRUE(clock.run_until([&] { return state().model.state != station::ModelState::sending; }, 40s));
  EXPECT_EQ(state().model.state, station::ModelState::confirmed) << state().model.reason;
}

}  // namespace
}  // namespace server
