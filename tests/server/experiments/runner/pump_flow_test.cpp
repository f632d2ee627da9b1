// Which flow a person is asked to set before an experiment.
#include "server/experiments/runner/pump_flow.hpp"

#include <gtest/gtest.h>

namespace server::experiments {
namespace {

storage::RunConditions stated(const std::string& pump, std::optional<double> mean_flow_m_s) {
  storage::RunConditions conditions;
  conditions.pump_profile = pump;
  conditions.mean_flow_m_s = mean_flow_m_s;
  return conditions;
}

Conditions needed(PumpFlow pump, double mean_flow_m_s) {
  Conditions conditions;
  conditions.pump = pump;
  conditions.mean_flow_m_s = mean_flow_m_s;
  return conditions;
}

TEST(FlowToSet, NothingWhereTheLastRunWasInThisFlow) {
  EXPECT_FALSE(flow_to_set(needed(PumpFlow::off, 0), {}));
  EXPECT_FALSE(flow_to_set(needed(PumpFlow::off, 0), stated("off", std::nullopt)));
  EXPECT_FALSE(flow_to_set(needed(PumpFlow::constant, -0.1), stated("constant", -0.1)));
}

TEST(FlowToSet, EveryOtherFlowNamesBoth) {
  EXPECT_TRUE(flow_to_set(needed(PumpFlow::constant, 0.1), {}));
  EXPECT_TRUE(flow_to_set(needed(PumpFlow::constant, 0.1), stated("constant", 0.05)));
  EXPECT_TRUE(flow_to_set(needed(PumpFlow::constant, 0.1), stated("pulse_70_bpm", 0.1)));
  EXPECT_TRUE(flow_to_set(needed(PumpFlow::off, 0), stated("as Tuesday", std::nullopt)));
  EXPECT_EQ(flow_to_set(needed(PumpFlow::pulse_70_bpm, 0.02), stated("off", 0)),
            "set the pump to 'pulse_70_bpm, mean 0.02 m/s' and resume; this robot's last run was in 'off'");
}

}  // namespace
}  // namespace server::experiments
