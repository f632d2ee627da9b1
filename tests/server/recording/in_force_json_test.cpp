// What was in force as JSON: the text that is stored, and the controller of the API.
#include "server/storage/samples/in_force_json.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

namespace server {
namespace {

using nlohmann::json;

rheonaut_Parameter parameter_of(float value) {
  rheonaut_Parameter parameter = rheonaut_Parameter_init_zero;
  std::strncpy(parameter.unit, "s", sizeof parameter.unit - 1);
  parameter.value = value;
  parameter.minimum = -1;
  parameter.maximum = 10;
  parameter.default_value = 2;
  return parameter;
}

TEST(InForceJsonTest, ATableOfParametersIsOneTextInTheOrderOfTheirNames) {
  const station::InForceContent table = station::ReportedParameters{{"b", parameter_of(3)}, {"a", parameter_of(0.1F)}};
  EXPECT_STREQ(storage::kind_of(table), "parameters");
  EXPECT_EQ(storage::document_text(table),
            R"({"a":{"default":2.0,"maximum":10.0,"minimum":-1.0,"unit":"s","value":0.1},)"
            R"("b":{"default":2.0,"maximum":10.0,"minimum":-1.0,"unit":"s","value":3.0}})");
}

TEST(InForceJsonTest, ANumberThatIsNoneIsNullAndABadNameIsStillJson) {
  const station::InForceContent table = station::ReportedParameters{{"\xff\xfe", parameter_of(std::nanf(""))}};
  EXPECT_TRUE(json::parse(storage::document_text(table)).front()["value"].is_null());
}

TEST(InForceJsonTest, AControllerHoldsTheCoefficientsAsTheyWereSent) {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.controller_id = 7;
  controller.kp = 3.4F;
  controller.pole_count = controller.residue_count = 2;
  controller.pole[1] = 0.5F;
  controller.residue[0] = -1.25F;
  controller.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT;
  const json written = storage::controller_json(controller);
  EXPECT_EQ(written["controller_id"], 7);
  EXPECT_EQ(written["kp"], 3.4);
  EXPECT_EQ(written["pole"], (json{0.0, 0.5}));
  EXPECT_EQ(written["residue"], (json{-1.25, 0.0}));
  EXPECT_EQ(written["biquad_b0"], json::array());
  EXPECT_EQ(written["derivative_on"], "measurement");
  EXPECT_STREQ(storage::kind_of(controller), "controller");
  EXPECT_EQ(storage::document_text(controller), written.dump());
}

}  // namespace
}  // namespace server
