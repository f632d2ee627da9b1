// The command that sets a parameter of a robot's model.
#include "server/station/models/parameter_request.hpp"

#include <gtest/gtest.h>

namespace server {
namespace {

TEST(ParameterRequestTest, NamesWhoeverNamedTheFluidAndTakesNoControl) {
  const station::CommandRequest request =
      station::set_parameter_request("r1", {"user:anna", "10.0.0.7", 5}, "model_time_constant_1_s", 0.1F);
  EXPECT_EQ(request.robot_id, "r1");
  EXPECT_EQ(request.actor, "user:anna");
  EXPECT_EQ(request.peer, "10.0.0.7");
  EXPECT_FALSE(request.takes_control);
  ASSERT_EQ(request.action.which_action, rheonaut_Command_set_parameter_tag);
  EXPECT_STREQ(request.action.action.set_parameter.name, "model_time_constant_1_s");
  EXPECT_EQ(request.action.action.set_parameter.value, 0.1F);
}

TEST(ParameterRequestTest, IsRecordedWithShortDecimals) {
  EXPECT_EQ(station::set_parameter_request("r1", {}, "model_gain_1_m_s", 0.1F).arguments,
            R"({"name":"model_gain_1_m_s","value":0.1})");
  EXPECT_EQ(station::set_parameter_request("r1", {}, "model_confirmed", 1).arguments,
            R"({"name":"model_confirmed","value":1.0})");
}

}  // namespace
}  // namespace server
