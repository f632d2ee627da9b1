// What the station reports of the model of a robot's fluid.
#include "server/station/models/model_report.hpp"

#include <gtest/gtest.h>

#include "tests/server/station/models/reported_parameters.hpp"

namespace server {
namespace {

station::FluidNaming named_water() { return {1, {"token:local", "", 0}, 7, "water", some_model()}; }
station::FluidNaming named_nothing() { return {2, {"token:local", "", 0}, 7, "", std::nullopt}; }

TEST(ModelReportTest, AModelIsReportedWithItsFluidFitAndDateFromItsSendingOn) {
  const std::int64_t set_at_us = some_model().set_at_us;
  EXPECT_EQ(model_on_its_way(named_water()),
            (station::RobotModel{station::ModelState::sending, "water", "", 0.002, set_at_us}));
  EXPECT_EQ(confirmed_model(named_water()),
            (station::RobotModel{station::ModelState::confirmed, "water", "", 0.002, set_at_us}));
  const Error error{ErrorCode::timed_out, "the motor is on", "motor_on"};
  EXPECT_EQ(failed_model(named_water(), error),
            (station::RobotModel{station::ModelState::failed, "water", "the motor is on", 0.002, set_at_us}));
}

TEST(ModelReportTest, WhatIsTakenBackIsOfNoFluid) {
  const Error error{ErrorCode::timed_out, "the motor is on", "motor_on"};
  EXPECT_EQ(model_on_its_way(named_nothing()),
            (station::RobotModel{station::ModelState::sending, "", "what was confirmed before is taken back", {}, 0}));
  EXPECT_EQ(failed_model(named_nothing(), error).reason,
            "what was confirmed before is not taken back yet: the motor is on");
  EXPECT_EQ(failed_model(named_nothing(), error).fluid, "");
  EXPECT_EQ(station::model_to_be_taken_back().reason, "what was confirmed before is not taken back yet");
  EXPECT_EQ(station::model_confirmed_by_command().fluid, "");
}

TEST(ModelReportTest, ARobotWithoutAModelOfItsFluidIsToldWhy) {
  station::FluidModelList models;
  models.put("water", some_model());
  EXPECT_EQ(unsent_model(models, "water").reason, "name the fluid again to send its model");
  EXPECT_EQ(unsent_model(models, "non_newtonian").reason, "there is no model of 'non_newtonian'");
  EXPECT_EQ(unsent_model(models, ""), station::RobotModel{});
}

TEST(ModelReportTest, EventsNameTheFluidAndWhoeverNamedIt) {
  EXPECT_EQ(confirmed_words(named_water()), "water by token:local");
  EXPECT_EQ(taken_back_words(named_water()), "the robot is in 'water'");
  EXPECT_EQ(taken_back_words(named_nothing()), "the robot is in a fluid that is not known");
  EXPECT_EQ(not_sent_words(named_water(), {ErrorCode::rejected, "busy", ""}),
            "the model of 'water' could not be sent: busy");
  station::FluidNaming own = named_water();
  own.own_beside_us = 0;
  EXPECT_EQ(confirmed_words(own), "its own model of water by token:local");
  EXPECT_EQ(confirmed_model(own).reason, "sent to this robot alone");
  const Error moves{ErrorCode::timed_out, "the motor is on; stop it", "motor_on"};
  EXPECT_EQ(not_sent_words(own, moves), "its own model of water could not be sent: the motor is on; stop it");
  EXPECT_EQ(failed_model(own, moves).reason, "the motor is on; stop it; then send the model again");
}

}  // namespace
}  // namespace server
