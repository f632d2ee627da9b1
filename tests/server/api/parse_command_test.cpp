// Bodies of commands: what is understood, and the sentence for what is not.
#include <gtest/gtest.h>

#include "server/api/bodies/json.hpp"
#include "server/http/http.hpp"

namespace server {
namespace {

TEST(ParseCommand, UnderstandsEveryKind) {
  const struct {
    const char* body;
    pb_size_t action;
  } cases[] = {
      {R"({"kind":"set_mode","mode":"manual"})", rheonaut_Command_set_mode_tag},
      {R"({"kind":"set_mode","mode":"auto","setpoint_m":0.1})", rheonaut_Command_set_mode_tag},
      {R"({"kind":"set_setpoint","setpoint_m":-0.25,"life_ms":500})", rheonaut_Command_set_setpoint_tag},
      {R"({"kind":"set_duty","duty":1})", rheonaut_Command_set_duty_tag},
      {R"({"kind":"set_duty","duty":0.5,"lease_ms":250})", rheonaut_Command_set_duty_tag},
      {R"({"kind":"renew_lease"})", rheonaut_Command_renew_lease_tag},
      {R"({"kind":"clear_emergency","emergency_id":"18446744073709551615"})", rheonaut_Command_clear_emergency_tag},
      {R"({"kind":"inject_disturbance","disturbance_m":-0.05})", rheonaut_Command_inject_disturbance_tag},
      {R"({"kind":"set_parameter","name":"model_confirmed","value":1})", rheonaut_Command_set_parameter_tag},
      {R"({"kind":"set_parameter","name":"position_limit_max_m","value":0.2,"confirm":true})",
       rheonaut_Command_set_parameter_tag},
      {R"({"kind":"get_parameters"})", rheonaut_Command_get_parameters_tag},
      {R"({"kind":"get_parameters","first_index":6})", rheonaut_Command_get_parameters_tag},
      {R"({"kind":"set_duty_schedule","schedule":[{"tick":0,"duty":0.1},{"tick":50,"duty":0}]})",
       rheonaut_Command_set_duty_schedule_tag},
      {R"({"kind":"set_controller","controller":{"period_us":10000,"kp":1,"direct":1},"duty_min":0,"duty_max":1})",
       rheonaut_Command_set_controller_tag},
      {R"({"kind":"restore_controller","confirm":true})", rheonaut_Command_restore_controller_tag},
      {R"({"kind":"zero_position"})", rheonaut_Command_zero_position_tag},
      {R"({"kind":"ping"})", rheonaut_Command_ping_tag},
  };
  for (const auto& one : cases) {
    const auto command = api::parse_command(one.body);
    ASSERT_TRUE(command) << one.body << ": " << command.error().detail;
    EXPECT_EQ(command->action.which_action, one.action) << one.body;
  }
}

TEST(ParseCommand, CarriesTheValues) {
  const auto command = api::parse_command(R"({"kind":"set_mode","mode":"auto","setpoint_m":0.1,"life_ms":500})");
  ASSERT_TRUE(command);
  EXPECT_EQ(command->action.action.set_mode.mode, rheonaut_MODE_AUTO);
  EXPECT_TRUE(command->action.action.set_mode.has_setpoint_m);
  EXPECT_EQ(command->action.action.set_mode.setpoint_m, 0.1F);
  EXPECT_EQ(command->time_to_live, std::chrono::milliseconds{500});
  EXPECT_EQ(command->arguments, R"({"mode":"auto","setpoint_m":0.1})");
  const auto timed = api::parse_command(R"({"kind":"set_duty","duty":0.1,"execute_at_robot_us":5000000})");
  ASSERT_TRUE(timed);
  EXPECT_TRUE(timed->action.has_execute_at_robot_us);
  EXPECT_EQ(timed->action.execute_at_robot_us, 5'000'000U);
  EXPECT_EQ(timed->arguments, R"({"duty":0.1,"execute_at_robot_us":5000000})");
  const auto clear = api::parse_command(R"({"kind":"clear_emergency","emergency_id":"18446744073709551615"})");
  ASSERT_TRUE(clear);
  EXPECT_EQ(clear->action.action.clear_emergency.emergency_id, UINT64_MAX);
}

TEST(ParseCommand, RefusesWithMemberAndValue) {
  const struct {
    const char* body;
    int status;
    const char* says;
  } cases[] = {
      {"", 400, "not valid JSON"},
      {"{", 400, "not valid JSON"},
      {R"({"kind":"set_setpoint","setpoint_m":NaN})", 400, "NaN"},
      {R"({"kind":"set_setpoint","setpoint_m":1e999})", 400, "not valid JSON"},
      {"[]", 400, "not a JSON object"},
      {"{}", 400, "kind is missing"},
      {R"({"kind":7})", 400, "kind = 7 is not a string"},
      {R"({"kind":"dance"})", 422, "unknown command kind 'dance'"},
      {R"({"kind":"emergency_stop"})", 422, "unknown command kind 'emergency_stop'"},
      {R"({"kind":"set_duty_schedule"})", 400, "schedule is missing"},
      {R"({"kind":"set_duty_schedule","schedule":[]})", 422, "has 0 entries"},
      {R"({"kind":"set_duty_schedule","schedule":[{"tick":0,"duty":0.1}]})", 422, "the last duty of a schedule is 0"},
      {R"({"kind":"set_duty_schedule","schedule":[{"tick":5,"duty":0.1},{"tick":5,"duty":0}]})", 422,
       "tick = 5 is outside 6"},
      {R"({"kind":"set_duty_schedule","schedule":[{"tick":0,"duty":0,"lease":1}]})", 400, "\"lease\" is not known"},
      {R"({"kind":"drop_timed"})", 422, "unknown command kind"},
      {R"({"kind":"ping","execute_at_robot_us":1})", 400, "ping takes no execute_at_robot_us"},
      {R"({"kind":"set_controller","controller":{},"execute_at_robot_us":1})", 400, "takes no execute_at_robot_us"},
      {R"({"kind":"set_duty","duty":0.1,"execute_at_robot_us":-1})", 422, "execute_at_robot_us = -1"},
      {R"({"kind":"get_parameters","first_index":256})", 422, "first_index = 256"},
      {R"({"kind":"set_controller"})", 400, "controller is missing"},
      {R"({"kind":"restore_controller","confirm":false})", 422, "confirm is true or left out"},
      {R"({"kind":"set_parameter","name":"","value":1})", 422, "name"},
      {R"({"kind":"set_parameter","name":"a_name_that_is_one_too_long_0123","value":1})", 422, "name"},
      {R"({"kind":"set_parameter","name":"model_confirmed"})", 400, "value is missing"},
      {R"({"kind":"set_parameter","name":"position_limit_max_m","value":0.2})", 422, "bounds motion"},
      {R"({"kind":"set_parameter","name":"position_limit_max_m","value":0.2,"confirm":1})", 422, "bounds motion"},
      {R"({"kind":"set_parameter","name":"model_confirmed","value":1,"confirm":true})", 400, "confirm goes only"},
      {R"({"kind":"set_setpoint"})", 400, "setpoint_m is missing"},
      {R"({"kind":"set_setpoint","setpoint_m":"0.1"})", 400, "setpoint_m = \"0.1\" is not a number"},
      {R"({"kind":"set_setpoint","setpoint_m":null})", 400, "setpoint_m = null is not a number"},
      {R"({"kind":"set_setpoint","setpoint_m":1e39})", 422, "setpoint_m = 1e+39 is beyond"},
      {R"({"kind":"set_setpoint","setpoint_m":0.1,"speed":1})", 400, "\"speed\" is not known"},
      {R"({"kind":"set_mode","mode":"auto"})", 400, "setpoint_m is missing"},
      {R"({"kind":"set_mode","mode":"manual","setpoint_m":0})", 400, "setpoint_m"},
      {R"({"kind":"set_mode","mode":"emergency"})", 422, "mode = 'emergency'"},
      {R"({"kind":"set_duty","duty":0.1,"lease_ms":501})", 422, "lease_ms = 501 is outside 1 to 500"},
      {R"({"kind":"set_duty","duty":0.1,"lease_ms":0.5})", 400, "lease_ms = 0.5 is not an integer"},
      {R"({"kind":"ping","life_ms":0})", 422, "life_ms = 0 is outside 1 to 10000"},
      {R"({"kind":"ping","life_ms":10001})", 422, "life_ms = 10001"},
      {R"({"kind":"ping","life_ms":18446744073709551615})", 422, "life_ms = 18446744073709551615"},
      {R"({"kind":"clear_emergency","emergency_id":5})", 400, "emergency_id = 5 is not a string"},
      {R"({"kind":"clear_emergency","emergency_id":"0"})", 400, "emergency_id"},
      {R"({"kind":"clear_emergency","emergency_id":"18446744073709551616"})", 400, "emergency_id"},
      {R"({"kind":"clear_emergency","emergency_id":"-1"})", 400, "emergency_id"},
      {R"({"kind":"clear_emergency","emergency_id":"12x"})", 400, "emergency_id"},
  };
  for (const auto& one : cases) {
    const auto command = api::parse_command(one.body);
    ASSERT_FALSE(command) << one.body;
    EXPECT_EQ(http::http_status(command.error().code), one.status) << one.body << ": " << command.error().detail;
    EXPECT_NE(command.error().detail.find(one.says), std::string::npos) << one.body << ": " << command.error().detail;
  }
}

TEST(ParseCommand, RefusesDeepNestingBeforeItIsParsed) {
  const auto nested = [](int levels) {
    return R"({"kind":)" + std::string(static_cast<std::size_t>(levels - 1), '[') +
           std::string(static_cast<std::size_t>(levels - 1), ']') + "}";
  };
  const auto deep = api::parse_command(nested(api::kMaxJsonDepth + 1));
  ASSERT_FALSE(deep);
  EXPECT_EQ(deep.error().detail, "the body is nested deeper than 16 levels");
  EXPECT_EQ(api::parse_command(nested(api::kMaxJsonDepth)).error().reason, "wrong_type");
  EXPECT_EQ(api::parse_command(nested(30'000)).error().reason, "malformed_json");
  EXPECT_EQ(api::parse_command(std::string(60'000, '[')).error().reason, "malformed_json");
  // Brackets in a text are text.
  EXPECT_TRUE(api::parse_marker(R"({"text":"[[[[[[[[[[[[[[[[[[[[\"[[{{"})"));
}

TEST(ParseRun, NeedsRobotAndNameAndKnowsItsMembers) {
  const auto request = api::parse_run(R"({"robot_id":"r1","name":"first","fluid":"water","mean_flow_m_s":0.02})");
  ASSERT_TRUE(request) << request.error().detail;
  EXPECT_EQ(request->conditions.name, "first");
  EXPECT_EQ(request->conditions.mean_flow_m_s, 0.02);
  EXPECT_FALSE(api::parse_run(R"({"robot_id":"r1"})"));
  EXPECT_FALSE(api::parse_run(R"({"robot_id":"R 1","name":"x"})"));
  EXPECT_FALSE(api::parse_run(R"({"robot_id":"r1","name":""})"));
  EXPECT_FALSE(api::parse_run(R"({"robot_id":"r1","name":"x","verdict":"good"})"));
  EXPECT_EQ(api::parse_run_end("").value(), "");
  EXPECT_EQ(api::parse_run_end(R"({"verdict":"good"})").value(), "good");
}

TEST(StateJson, WritesFloatsAsTheShortestDecimal) {
  EXPECT_EQ(base::decimal(0.1F).dump(), "0.1");
  EXPECT_EQ(base::decimal(std::numeric_limits<float>::quiet_NaN()).dump(), "null");
  EXPECT_EQ(base::decimal(1e-30F).dump(), "1e-30");
}

TEST(StateJson, ReplacesBytesThatAreNotText) {
  station::RobotState robot;
  robot.id = "r1";
  robot.firmware_version = "1.0\xff";
  EXPECT_EQ(nlohmann::json::parse(base::dump(live::to_json(robot)))["firmware_version"], "1.0\xef\xbf\xbd");
}

// As JSON Schema has it, by which the document says what an integer is.
TEST(ParseCommand, AnIntegerMayBeWrittenWithAPoint) {
  const auto life = [](const char* number) {
    return api::parse_command(std::string{R"({"kind":"ping","life_ms":)"} + number + "}");
  };
  for (const char* number : {"2000", "2000.0", "2e3", "20000e-1"}) {
    ASSERT_TRUE(life(number)) << number;
    EXPECT_EQ(life(number)->time_to_live, 2s) << number;
  }
  EXPECT_EQ(life("2000.5").error().reason, "wrong_type");
  for (const char* number : {"1e300", "-1e300", "1e19", "9007199254740994.0", "0.0", "18446744073709551615"}) {
    EXPECT_EQ(life(number).error().reason, "out_of_range") << number;
  }
}

}  // namespace
}  // namespace server
