// What a run was made with: as the robot's core told it, as the recording keeps it.
#include <nlohmann/json.hpp>

#include "robot_fw/core/controller.hpp"
#include "robot_fw/core/parameters.hpp"
#include "tests/robot_fw/controllers.hpp"
#include "tests/system/station_fixture.hpp"

namespace server {
namespace {

using nlohmann::json;

class SnapshotTest : public SystemTest {
 protected:
  storage::RunSnapshot snapshot_of(storage::RunId run) { return wait_for(runs->snapshot(run)).value(); }

  // In order of first_seq.
  static std::vector<json> records_of(const storage::RunSnapshot& snapshot, const std::string& kind) {
    std::vector<json> documents;
    for (const storage::InForce& document : snapshot.in_force) {
      if (document.kind == kind) documents.push_back(json::parse(document.content));
    }
    return documents;
  }
};

TEST_F(SnapshotTest, TheParametersAndTheControllerOfTheCoreAreThoseOfTheRun) {
  begin();
  pass(1);
  const storage::RunSnapshot snapshot = snapshot_of(begin_run());
  EXPECT_EQ(snapshot.firmware_version, state().firmware_version);
  EXPECT_FALSE(snapshot.firmware_version.empty());
  EXPECT_EQ(snapshot.parameters_checksum, robot_fw::Parameters{}.checksum());

  const auto parameters = records_of(snapshot, "parameters");
  ASSERT_EQ(parameters.size(), 1U);
  EXPECT_EQ(parameters[0].size(), robot_fw::kParameterCount);
  for (std::size_t i = 0; i < robot_fw::kParameterCount; ++i) {
    const robot_fw::ParameterSpec& spec = robot_fw::Parameters::spec(i);
    ASSERT_TRUE(parameters[0].contains(spec.name)) << spec.name;
    EXPECT_EQ(parameters[0][spec.name]["value"].get<float>(), spec.default_value) << spec.name;
    EXPECT_EQ(parameters[0][spec.name]["unit"], spec.unit);
  }

  const auto controllers = records_of(snapshot, "controller");
  ASSERT_EQ(controllers.size(), 1U);
  const json& controller = controllers[0];
  EXPECT_EQ(controller["checksum"], snapshot.controller_checksum);
  EXPECT_EQ(controller["controller_id"], snapshot.controller_id);
  EXPECT_EQ(controller["kp"].get<float>(), robot_fw::kPaperController.kp);
  EXPECT_EQ(controller["direct"].get<float>(), robot_fw::kPaperController.direct);
  ASSERT_EQ(controller["pole"].size(), robot_fw::kPaperController.count);
  for (std::size_t i = 0; i < robot_fw::kPaperController.count; ++i) {
    EXPECT_EQ(controller["pole"][i].get<float>(), robot_fw::kPaperController.pole(i));
    EXPECT_EQ(controller["residue"][i].get<float>(), robot_fw::kPaperController.residue(i));
  }
}

TEST_F(SnapshotTest, WhatChangesWhileARunIsOpenIsInItFromThatSampleOn) {
  begin();
  const storage::RunId run = begin_run();
  pass(1);
  const auto set = send(sim_robot::set_parameter("power_limit_s", 7)).expect_accepted();
  const auto sent = send(sim_robot::set_controller(robot_fw::biquad_controller())).expect_accepted();
  pass(1);
  expect_whole(run);
  const storage::RunSnapshot snapshot = snapshot_of(run);

  const auto parameters = records_of(snapshot, "parameters");
  ASSERT_EQ(parameters.size(), 2U);
  EXPECT_NE(parameters[0]["power_limit_s"]["value"], 7);
  EXPECT_EQ(parameters[1]["power_limit_s"]["value"], 7);
  const auto controllers = records_of(snapshot, "controller");
  ASSERT_EQ(controllers.size(), 2U);
  EXPECT_EQ(controllers[0]["kp"].get<float>(), robot_fw::kPaperController.kp);
  EXPECT_EQ(controllers[1]["kp"], 30);
  EXPECT_EQ(controllers[1]["biquad_b0"], json::array({0.25}));
  EXPECT_EQ(controllers[1]["biquad_a2"], json::array({0.625}));
  EXPECT_EQ(controllers[1]["derivative_on"], "measurement");

  // From the first sample made after the command took effect, or one that follows soon, since it is told a little
  // later.
  const auto changed_at_us = [&snapshot](const std::string& kind) {
    std::uint64_t seq = 0;
    for (const storage::InForce& document : snapshot.in_force) {
      if (document.kind == kind) seq = document.first_seq;
    }
    return seq * 10'000;
  };
  EXPECT_GE(changed_at_us("parameters"), set.effect_at_robot_us);
  EXPECT_LE(changed_at_us("parameters"), set.effect_at_robot_us + 100'000);
  EXPECT_GE(changed_at_us("controller"), sent.effect_at_robot_us);
  EXPECT_LE(changed_at_us("controller"), sent.effect_at_robot_us + 100'000);
}

}  // namespace
}  // namespace server
