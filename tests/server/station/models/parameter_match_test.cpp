// Whether what a robot has reported is the model of a fluid.
#include "server/station/models/parameter_match.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/station/models/reported_parameters.hpp"

namespace server {
namespace {

TEST(ParameterMatchTest, AllEightMustBeReportedToHoldAModel) {
  auto values = values_of(some_model());
  EXPECT_TRUE(holds(table_of(values), some_model()));
  EXPECT_FALSE(holds_another(table_of(values), some_model()));
  values.erase("model_gain_4_m_s");
  EXPECT_FALSE(holds(table_of(values), some_model()));
  EXPECT_FALSE(holds_another(table_of(values), some_model())) << "nothing speaks against it";
  EXPECT_FALSE(holds(station::ParameterTable{}, some_model()));
}

// SAFETY's test: the nearest float is another model.
TEST(ParameterMatchTest, OneOtherBitIsAnotherModel) {
  auto values = values_of(some_model());
  values["model_gain_2_m_s"] = std::nextafter(-0.5F, 0.0F);
  EXPECT_FALSE(holds(table_of(values), some_model()));
  EXPECT_TRUE(holds_another(table_of(values), some_model()));
  values = values_of(some_model());
  values["model_gain_4_m_s"] = -0.0F;
  EXPECT_TRUE(holds_another(table_of(values), some_model())) << "as bits, not as numbers";
}

}  // namespace
}  // namespace server
