// The table of parameters put together from pages, whatever the pages say.
#include "server/station/state/in_force.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace server {
namespace {

using nlohmann::json;

protocol::ParameterPage page_of(std::uint32_t total, std::initializer_list<std::pair<const char*, float>> values) {
  protocol::ParameterPage page = rheonaut_ParameterPage_init_zero;
  page.total = total;
  for (const auto& [name, value] : values) {
    rheonaut_Parameter& parameter = page.parameters[page.parameters_count++];
    std::strncpy(parameter.name, name, sizeof parameter.name - 1);
    std::strncpy(parameter.unit, "s", sizeof parameter.unit - 1);
    parameter.value = value;
    parameter.minimum = -1;
    parameter.maximum = 10;
    parameter.default_value = 2;
  }
  return page;
}

TEST(ParameterTableTest, IsReportedWhenEveryParameterIsKnownAndAgainWhenOneHasChanged) {
  ParameterTable table;
  EXPECT_FALSE(table.add(page_of(3, {{"a", 0.1F}, {"b", 2}})).has_value());
  const auto whole = table.add(page_of(3, {{"c", 3}}));
  ASSERT_TRUE(whole.has_value());
  const json expected = {{"value", 0.1}, {"unit", "s"}, {"minimum", -1.0}, {"maximum", 10.0}, {"default", 2.0}};
  EXPECT_EQ(json::parse(*whole)["a"], expected);
  EXPECT_EQ(json::parse(*whole).size(), 3u);

  EXPECT_FALSE(table.add(page_of(3, {{"b", 2}})).has_value()) << "nothing has changed";
  const auto changed = table.add(page_of(3, {{"b", 5}}));
  ASSERT_TRUE(changed.has_value());
  EXPECT_EQ(json::parse(*changed)["b"]["value"], 5.0);
}

TEST(ParameterTableTest, ARobotThatNamesEverMoreParametersFillsNoMemory) {
  ParameterTable table;
  for (int i = 0; i < 10'000; ++i) {
    EXPECT_FALSE(table.add(page_of(1, {{("p" + std::to_string(i)).c_str(), 1}, {"q", 1}})).has_value());
  }
  EXPECT_FALSE(table.add(page_of(4'000'000'000, {{"a", 1}})).has_value());
}

TEST(ParameterTableTest, ANumberThatIsNoneIsNullAndABadNameIsStillJson) {
  ParameterTable table;
  const auto whole = table.add(page_of(1, {{"\xff\xfe", std::nanf("")}}));
  ASSERT_TRUE(whole.has_value());
  EXPECT_TRUE(json::parse(*whole).front()["value"].is_null());
}

TEST(ControllerJsonTest, HoldsTheCoefficientsAsTheyWereSent) {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.controller_id = 7;
  controller.kp = 3.4F;
  controller.pole_count = controller.residue_count = 2;
  controller.pole[1] = 0.5F;
  controller.residue[0] = -1.25F;
  controller.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT;
  const json written = json::parse(controller_json(controller));
  EXPECT_EQ(written["controller_id"], 7);
  EXPECT_EQ(written["kp"], 3.4);
  EXPECT_EQ(written["pole"], (json{0.0, 0.5}));
  EXPECT_EQ(written["residue"], (json{-1.25, 0.0}));
  EXPECT_EQ(written["biquad_b0"], json::array());
  EXPECT_EQ(written["derivative_on"], "measurement");
}

}  // namespace
}  // namespace server
