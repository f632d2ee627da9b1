// Parameters over the link: read, set, refused, and in effect.
#include "robot_fw/core/parameters.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

class ParametersOverTheLink : public DrivenRobot {
 protected:
  std::string set(const char* name, float value) { return answer(set_parameter(name, value)); }
  float in_force(const char* name) {
    order(get_parameters(static_cast<std::uint32_t>(*Parameters::find(name))));
    return station.pages.back().parameters[0].value;
  }
  std::uint32_t checksum() {
    station.disconnect();
    station.connect();
    return station.hello->parameters_checksum;
  }
};

TEST(ParameterTable, HasDistinctNamesThatFitAndDefaultsInRange) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < kParameterCount; ++i) {
    const ParameterSpec& spec = Parameters::spec(i);
    EXPECT_TRUE(names.insert(spec.name).second);
    EXPECT_LT(std::strlen(spec.name), sizeof(rheonaut_Parameter::name));
    EXPECT_LT(std::strlen(spec.unit), sizeof(rheonaut_Parameter::unit));
    EXPECT_TRUE(Parameters::in_range(i, spec.default_value)) << spec.name;
    EXPECT_EQ(Parameters::find(spec.name), i);
  }
}

TEST(ParameterTable, EveryIdNamesItsRow) {
  const Parameters p;
  EXPECT_EQ(p[ParameterId::auto_limit_s], 600);
  EXPECT_EQ(Parameters::find("auto_limit_s"), static_cast<std::size_t>(ParameterId::auto_limit_s));
  EXPECT_EQ(Parameters::find("setpoint_limit_m"), static_cast<std::size_t>(ParameterId::setpoint_limit_m));
  EXPECT_EQ(Parameters::find("link_timeout_ms"), static_cast<std::size_t>(ParameterId::link_timeout_ms));
  EXPECT_EQ(Parameters::find("profile_velocity_m_s"), static_cast<std::size_t>(ParameterId::profile_velocity_m_s));
  EXPECT_EQ(Parameters::find("duty_slew_per_s"), static_cast<std::size_t>(ParameterId::duty_slew_per_s));
  EXPECT_EQ(Parameters::find("position_limit_min_m"), static_cast<std::size_t>(ParameterId::position_limit_min_m));
  EXPECT_EQ(Parameters::find("position_limit_max_m"), static_cast<std::size_t>(ParameterId::position_limit_max_m));
  EXPECT_EQ(Parameters::find("power_limit_duty"), static_cast<std::size_t>(ParameterId::power_limit_duty));
  EXPECT_EQ(Parameters::find("power_limit_s"), static_cast<std::size_t>(ParameterId::power_limit_s));
  EXPECT_EQ(Parameters::find("link_loss_action"), static_cast<std::size_t>(ParameterId::link_loss_action));
  EXPECT_EQ(Parameters::find("link_loss_limit_s"), static_cast<std::size_t>(ParameterId::link_loss_limit_s));
  EXPECT_EQ(Parameters::find("impedance_monitor"), static_cast<std::size_t>(ParameterId::impedance_monitor));
  EXPECT_EQ(Parameters::find("delivery_limit_s"), static_cast<std::size_t>(ParameterId::delivery_limit_s));
  EXPECT_EQ(Parameters::find("model_gain_1_m_s"), static_cast<std::size_t>(ParameterId::model_gain_1_m_s));
  EXPECT_EQ(Parameters::find("model_time_constant_1_s"),
            static_cast<std::size_t>(ParameterId::model_time_constant_1_s));
  EXPECT_EQ(Parameters::find("dead_zone_duty"), static_cast<std::size_t>(ParameterId::dead_zone_duty));
  EXPECT_EQ(Parameters::find("acceleration_bias_walk_m_s2"),
            static_cast<std::size_t>(ParameterId::acceleration_bias_walk_m_s2));
}

// Computed apart, with Python: binascii.crc32 over name.encode() + struct.pack("<f", value) of each row.
TEST(ParameterTable, HasTheChecksumThatTheDocumentDefines) {
  const Parameters p;
  EXPECT_EQ(p.checksum(), 0xC648697EU);
}

TEST_F(ParametersOverTheLink, ArePagedSixAtATime) {
  for (std::uint32_t first = 0; first < kParameterCount; first += 6) {
    EXPECT_EQ(answer(get_parameters(first)), "accepted");
  }
  ASSERT_EQ(station.pages.size(), (kParameterCount + 5) / 6);
  std::size_t index = 0;
  for (const auto& page : station.pages) {
    EXPECT_EQ(page.first_index, index);
    EXPECT_EQ(page.parameters_count, std::min<std::size_t>(6, kParameterCount - index));
    EXPECT_EQ(page.total, kParameterCount);
    EXPECT_NE(page.command_id, 0u);
    for (pb_size_t i = 0; i < page.parameters_count; ++i, ++index) {
      const ParameterSpec& spec = Parameters::spec(index);
      EXPECT_STREQ(page.parameters[i].name, spec.name);
      EXPECT_STREQ(page.parameters[i].unit, spec.unit);
      EXPECT_EQ(page.parameters[i].value, spec.default_value);
      EXPECT_EQ(page.parameters[i].minimum, spec.minimum);
      EXPECT_EQ(page.parameters[i].maximum, spec.maximum);
      EXPECT_EQ(page.parameters[i].default_value, spec.default_value);
    }
  }
  EXPECT_EQ(answer(get_parameters(kParameterCount)), "out_of_range");
}

TEST_F(ParametersOverTheLink, ASetIsAnsweredWithTheValueInForce) {
  const auto ack = order(set_parameter("auto_limit_s", 30));
  EXPECT_EQ(result(ack), "accepted");
  ASSERT_EQ(station.pages.size(), 1u);
  EXPECT_EQ(station.pages[0].command_id, ack.command_id);
  EXPECT_EQ(station.pages[0].parameters_count, 1u);
  EXPECT_STREQ(station.pages[0].parameters[0].name, "auto_limit_s");
  EXPECT_EQ(station.pages[0].parameters[0].value, 30);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_PARAMETER_CHANGED), 1);
}

TEST_F(ParametersOverTheLink, ARefusedSetChangesNothing) {
  EXPECT_EQ(set("no_such_thing", 1), "unknown_parameter");
  EXPECT_EQ(set("", 1), "unknown_parameter");
  EXPECT_EQ(set("auto_limit_s", std::nanf("")), "not_finite");
  EXPECT_EQ(set("auto_limit_s", INFINITY), "not_finite");
  EXPECT_EQ(set("auto_limit_s", 0.5F), "out_of_range");
  EXPECT_EQ(set("auto_limit_s", 3601), "out_of_range");
  EXPECT_TRUE(station.pages.empty());
  EXPECT_EQ(in_force("auto_limit_s"), 600);
}

TEST_F(ParametersOverTheLink, WhatShapesMotionStaysAsItIsWhileTheMotorIsOn) {
  order(set_auto(0.1F));
  int refused = 0;
  for (std::size_t i = 0; i < kParameterCount; ++i) {
    const ParameterSpec& spec = Parameters::spec(i);
    EXPECT_EQ(set(spec.name, spec.default_value), spec.only_at_rest ? "motor_on" : "accepted");
    refused += spec.only_at_rest;
  }
  EXPECT_EQ(refused, static_cast<int>(kParameterCount) - 3);
  order(set_manual());
  EXPECT_EQ(set("duty_slew_per_s", 1), "accepted");
  order(set_duty(0.1F));
  EXPECT_EQ(set("duty_slew_per_s", 2), "motor_on");
}

TEST_F(ParametersOverTheLink, AChangeOfTheModelTakesItsConfirmationBack) {
  EXPECT_EQ(last().flags & rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED, 0u);
  EXPECT_EQ(set("model_confirmed", 1), "accepted");
  station.run(2);
  EXPECT_NE(last().flags & rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED, 0u);
  EXPECT_EQ(set("model_gain_error", 0.1F), "accepted");  // says how well the model is known, and is no part of it
  EXPECT_EQ(in_force("model_confirmed"), 1);
  station.pages.clear();
  EXPECT_EQ(set("model_time_constant_2_s", 0.07F), "accepted");
  station.run(2);
  EXPECT_EQ(last().flags & rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED, 0u);
  EXPECT_EQ(station.pages.size(), 1u);  // the answer
  const auto& unasked = station.table.back();
  EXPECT_STREQ(unasked.parameters[0].name, "model_confirmed");
  EXPECT_EQ(unasked.parameters[0].value, 0);
}

// The station knows of each change: one that takes the confirmation back is two pages, or none.
TEST_F(ParametersOverTheLink, AChangeThatTakesTheConfirmationBackIsBusyWithoutRoomForBothPages) {
  EXPECT_EQ(set("model_confirmed", 1), "accepted");
  const auto pages_before = station.table.size();
  for (int i = 0; i < 3; ++i) station.send(set_parameter("auto_limit_s", 30));
  const auto change = station.send(set_parameter("model_gain_1_m_s", 0.1F));
  station.step();
  EXPECT_EQ(result(*station.ack_of(change)), "busy");
  EXPECT_EQ(in_force("model_confirmed"), 1);
  EXPECT_NE(in_force("model_gain_1_m_s"), 0.1F);

  for (int i = 0; i < 2; ++i) station.send(set_parameter("auto_limit_s", 30));
  const auto again = station.send(set_parameter("model_gain_1_m_s", 0.1F));
  station.step();
  EXPECT_EQ(result(*station.ack_of(again)), "accepted");
  ASSERT_EQ(station.table.size(), pages_before + 1);
  EXPECT_STREQ(station.table.back().parameters[0].name, "model_confirmed");
  EXPECT_EQ(station.table.back().parameters[0].value, 0);
}

TEST_F(ParametersOverTheLink, WhatNamesAChoiceIsAWholeNumber) {
  EXPECT_EQ(set("link_loss_action", 0.5F), "out_of_range");
  EXPECT_EQ(set("link_loss_action", 2), "accepted");
  EXPECT_EQ(set("impedance_monitor", 0.999F), "out_of_range");
  EXPECT_EQ(set("impedance_monitor", 0), "accepted");
}

TEST(ParameterTable, GivesTheEstimatorsDefaultsBack) {
  const EstimatorParameters by_table = Parameters{}.estimator(), preset;
  EXPECT_EQ(by_table.model.gain_m_s, preset.model.gain_m_s);
  EXPECT_EQ(by_table.model.time_constant_s, preset.model.time_constant_s);
  EXPECT_EQ(by_table.dead_zone_duty, preset.dead_zone_duty);
  EXPECT_EQ(by_table.doubtful_duty, preset.doubtful_duty);
  EXPECT_EQ(by_table.gain_error, preset.gain_error);
  EXPECT_EQ(by_table.shape_error, preset.shape_error);
  EXPECT_EQ(by_table.driven_velocity_m_s, preset.driven_velocity_m_s);
  EXPECT_EQ(by_table.resting_velocity_m_s, preset.resting_velocity_m_s);
  EXPECT_EQ(by_table.correlation_s, preset.correlation_s);
  EXPECT_EQ(by_table.noise_m_s2, preset.noise_m_s2);
  EXPECT_EQ(by_table.bias_m_s2, preset.bias_m_s2);
  EXPECT_EQ(by_table.bias_walk_m_s2, preset.bias_walk_m_s2);
}

TEST_F(ParametersOverTheLink, MayBeSetInEmergency) {
  order(emergency_stop());
  EXPECT_EQ(set("duty_slew_per_s", 1), "accepted");
}

TEST_F(ParametersOverTheLink, AreBusyWhenTooManyAnswersWait) {
  for (int i = 0; i < 6; ++i) station.send(get_parameters(0));
  station.step();
  EXPECT_EQ(station.pages.size(), 4u);
  EXPECT_EQ(result(station.acks.back()), "busy");
  EXPECT_EQ(answer(get_parameters(0)), "accepted");
}

TEST_F(ParametersOverTheLink, TheWholeTableFollowsEachWelcomeUnasked) {
  order(set_parameter("auto_limit_s", 42));
  for (int connection = 0; connection < 2; ++connection) {
    station.table.clear();
    station.controllers.clear();
    station.disconnect();
    station.connect();
    station.run(20);
    std::size_t next = 0;
    for (const auto& page : station.table) {
      EXPECT_EQ(page.first_index, next);
      EXPECT_EQ(page.total, kParameterCount);
      for (pb_size_t i = 0; i < page.parameters_count; ++i, ++next) {
        EXPECT_STREQ(page.parameters[i].name, Parameters::spec(next).name);
        const bool is_set = std::string{page.parameters[i].name} == "auto_limit_s";
        EXPECT_EQ(page.parameters[i].value, is_set ? 42 : Parameters::spec(next).default_value);
      }
    }
    EXPECT_EQ(next, kParameterCount);
    ASSERT_EQ(station.controllers.size(), 1u);
    EXPECT_EQ(station.controllers[0].controller_id, 1u);
  }
}

TEST_F(ParametersOverTheLink, HelloCarriesTheChecksumOfTheTableInForce) {
  const auto before = checksum();
  EXPECT_EQ(before, Parameters{}.checksum());
  order(set_parameter("auto_limit_s", 599));
  EXPECT_NE(checksum(), before);
  order(set_parameter("auto_limit_s", 600));
  EXPECT_EQ(checksum(), before);
}

TEST_F(ParametersOverTheLink, AutoEndsAfterItsLimit) {
  order(set_parameter("auto_limit_s", 2));
  order(set_auto(0));
  station.run(198);
  EXPECT_EQ(mode(), "auto");
  station.run(4);
  EXPECT_EQ(mode(), "manual");
  for (const auto& event : station.events) {
    if (event.kind == rheonaut_EVENT_KIND_AUTO_LIMIT) EXPECT_EQ(event.value, 2);
  }
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_AUTO_LIMIT), 1);
}

TEST_F(ParametersOverTheLink, SetpointsLieWithinTheirLimit) {
  EXPECT_EQ(answer(set_auto(1.5F)), "out_of_range");
  order(set_parameter("setpoint_limit_m", 2));
  EXPECT_EQ(answer(set_auto(1.5F)), "accepted");
  EXPECT_EQ(answer(set_setpoint(-2.1F)), "out_of_range");
}

TEST_F(ParametersOverTheLink, TheLinkTimeOutIsTheRobotsOwnFromTheNextWelcomeOn) {
  order(set_parameter("link_timeout_ms", 300));
  station.disconnect();
  station.connect();
  station.attentive = false;
  station.run(29);
  EXPECT_FALSE(core().link_lost());
  station.run(4);
  EXPECT_TRUE(core().link_lost());
}

}  // namespace
}  // namespace robot_fw
