// Every command and event in every state, as the tables of docs/robot.md say, which are read here.
#include <algorithm>
#include <string>

#include "tests/robot_fw/bare_core.hpp"
#include "tests/robot_fw/mode_cases.hpp"
#include "tests/robot_fw/mode_page.hpp"

namespace robot_fw {
namespace {

using Words = std::vector<std::string>;

bool can_be_cleared(BareCore core) {
  const auto answer = core.order(sim_robot::clear_emergency(core.robot.emergency_id()));
  if (answer.result == rheonaut_COMMAND_RESULT_ACCEPTED) return true;
  EXPECT_EQ(answer.reason, rheonaut_REJECT_REASON_CAUSE_STANDS);
  return false;
}

// The state in the page's words, found by asking copies of the core.
std::string state_of(const BareCore& core) {
  BareCore asked = core;
  const protocol::Telemetry& sample = core.sample;
  if (sample.mode == rheonaut_MODE_AUTO) return protocol::text(sample.sub_state);
  if (sample.mode == rheonaut_MODE_EMERGENCY) {
    if (!can_be_cleared(core)) return "sensor";
    asked.impedance_mv = 0;
    asked.run(5);
    return can_be_cleared(asked) ? "emergency" : "recovered";
  }
  const bool runs = asked.order(sim_robot::renew_lease()).result == rheonaut_COMMAND_RESULT_ACCEPTED;
  if (runs) return sample.duty[0] == kScheduleDuty ? "schedule" : "duty";
  EXPECT_EQ(sample.duty[0], 0);
  if (sample.flags & rheonaut_TELEMETRY_FLAG_POSITION_LIMIT) return "outside";
  return sample.flags & rheonaut_TELEMETRY_FLAG_SENSOR_FAULT ? "faulty" : "rest";
}

// Events as "kind/cause". What the model makes of sensors set by hand does not matter here.
Words noted(const std::vector<protocol::Event>& events) {
  Words words;
  for (const auto& event : events) {
    if (event.kind == rheonaut_EVENT_KIND_MODEL_MISMATCH) continue;
    EXPECT_TRUE(event.mode == rheonaut_MODE_AUTO || event.sub_state == rheonaut_SUB_STATE_NONE);
    words.push_back(std::string(protocol::text(event.kind)) + "/" + protocol::text(event.cause));
  }
  std::sort(words.begin(), words.end());
  return words;
}

// What the page says is noted: by the row, and by the change from one state to the other.
Words expected_events(const PageRow& row, const std::string& cell, const BareCore& before, const BareCore& after) {
  Words kinds = cell == "-" || cell == "later" ? Words{} : row.notes;
  const auto note_if = [&](bool change, const char* kind) {
    if (change) kinds.push_back(kind);
  };
  const bool is_reset = row.name.starts_with("reset");
  const auto was = before.sample.mode, is = after.sample.mode;
  const bool was_auto = was == rheonaut_MODE_AUTO, is_auto = is == rheonaut_MODE_AUTO;
  const bool was_latched = was == rheonaut_MODE_EMERGENCY, is_latched = is == rheonaut_MODE_EMERGENCY;
  const bool delivered = before.sample.sub_state == rheonaut_SUB_STATE_DELIVERING;
  const bool delivers = after.sample.sub_state == rheonaut_SUB_STATE_DELIVERING;
  note_if(is_latched && (is_reset || after.robot.emergency_id() != before.robot.emergency_id()), "emergency");
  note_if(is_auto && (!was_auto || after.sample.setpoint_m != before.sample.setpoint_m), "setpoint_changed");
  if (!is_reset) {
    note_if(was_latched && !is_latched, "emergency_cleared");
    note_if(!was_latched && !is_latched && was_auto != is_auto, "mode_changed");
    note_if(delivered && !delivers, "delivery_ended");
    note_if(!delivered && delivers, "delivery_started");
  }
  // Readings far out of range throw the robot off its setpoint before there are enough of them.
  note_if(row.latches == "sensor_out_of_range" && row.cause == "sensor" &&
              before.sample.sub_state == rheonaut_SUB_STATE_HOLDING,
          "sub_state_changed");
  Words words;
  for (const auto& kind : kinds) {
    const bool without_cause = kind == "link_restored" || kind == "sub_state_changed";
    words.push_back(kind + "/" + (without_cause ? "none" : row.cause));
  }
  std::sort(words.begin(), words.end());
  return words;
}

// Both go on alike, until every lease has run out: nobody can tell that something was said to one of them.
void expect_alike(BareCore one, BareCore other, int ticks) {
  one.renews = other.renews = false;
  for (int i = 0; i < ticks; ++i) {
    one.tick();
    other.tick();
    ASSERT_EQ(one.robot.float_state_checksum(), other.robot.float_state_checksum());
    ASSERT_EQ(one.robot.emergency_id(), other.robot.emergency_id());
    ASSERT_EQ(one.sample.mode, other.sample.mode);
    ASSERT_EQ(one.sample.sub_state, other.sample.sub_state);
    ASSERT_EQ(one.sample.has_setpoint_m, other.sample.has_setpoint_m);
    ASSERT_EQ(one.sample.setpoint_m, other.sample.setpoint_m);
    ASSERT_EQ(one.sample.disturbance_m, other.sample.disturbance_m);
    ASSERT_EQ(one.sample.duty[0], other.sample.duty[0]);
    ASSERT_EQ(one.sample.flags, other.sample.flags);
  }
  ASSERT_EQ(noted(one.events), noted(other.events));
  const auto hello = one.hello_now(), other_hello = other.hello_now();
  ASSERT_EQ(hello.parameters_checksum, other_hello.parameters_checksum);
  ASSERT_EQ(hello.controller_checksum, other_hello.controller_checksum);
}

void expect_transition(const PageRow& row, const std::string& cell, const BareCore& before, const BareCore& after) {
  const std::string state = state_of(before);
  const bool stays = cell == "=" || cell == "-" || cell == "later" || cell == "again";
  EXPECT_EQ(state_of(after), stays ? state : cell);
  EXPECT_EQ(noted(after.events), expected_events(row, cell, before, after));
  const bool was_latched = before.robot.emergency_id() != 0, is_latched = after.robot.emergency_id() != 0;
  const bool new_latch = is_latched && after.robot.emergency_id() != before.robot.emergency_id();
  EXPECT_EQ(new_latch, is_latched && (!was_latched || row.name == "emergency_stop"));
  if (new_latch) EXPECT_EQ(protocol::text(after.sample.emergency_cause), row.latches);
  const bool has = std::count(row.notes.begin(), row.notes.end(), "parameter_changed") > 0;
  const auto hello = before.hello_now(), hello_after = after.hello_now();
  const bool is_reset = row.name.starts_with("reset");
  EXPECT_EQ(hello.parameters_checksum != hello_after.parameters_checksum, has || is_reset);
  if (is_reset) {  // nothing moves by itself
    EXPECT_EQ(after.robot.duty(), 0);
    EXPECT_NE(after.sample.mode, rheonaut_MODE_AUTO);
  }
}

class EveryState : public ::testing::TestWithParam<StateCase> {
 protected:
  BareCore in_state(const ParameterValues& parameters) const {
    BareCore core = prepared(GetParam(), parameters);
    EXPECT_EQ(state_of(core), GetParam().state);
    core.events.clear();
    return core;
  }
};

TEST_P(EveryState, AnswersEachCommandAsThePageSays) {
  const PageTable table = page_table("command");
  ASSERT_EQ(names_of(table), names_of(kCommandCases));
  for (const CommandCase& each : kCommandCases) {
    const PageRow row = table.at(each.name);
    const std::string cell = row.cells.at(GetParam().state);
    SCOPED_TRACE(each.name + std::string(" in ") + GetParam().name + ": " + cell);
    const BareCore before = in_state({});
    BareCore after = before;
    const protocol::Command command = each.command(before);
    const auto ack = after.order(command);
    const bool accepted = ack.result == rheonaut_COMMAND_RESULT_ACCEPTED;
    ASSERT_EQ(accepted, !is_reason(cell)) << protocol::text(ack.reason);
    if (accepted) {
      EXPECT_EQ(ack.effect_at_robot_us, after.now_us);
      after.tick();
      expect_transition(row, cell, before, after);
    } else {
      EXPECT_EQ(ack.result, rheonaut_COMMAND_RESULT_REJECTED);
      EXPECT_EQ(protocol::text(ack.reason), cell);
      EXPECT_EQ(ack.effect_at_robot_us, 0u);
      expect_alike(after, before, 60);
    }
    if (command.which_action == rheonaut_Command_emergency_stop_tag || command.which_action == 0) continue;
    if (cell == "latched") {  // also for later: after a clear nothing moves by itself
      BareCore ahead = before;
      protocol::Command later = command;
      later.has_execute_at_robot_us = true;
      later.execute_at_robot_us = before.now_us + 2 * BareCore::kTickUs;
      EXPECT_EQ(ahead.order(later).reason, rheonaut_REJECT_REASON_LATCHED);
      expect_alike(ahead, before, 3);
    }
    BareCore late = before, elsewhere = before, twice = after;
    protocol::Command stale = command;
    stale.valid_until_robot_us = before.now_us - 1;
    EXPECT_EQ(late.order(stale).result, rheonaut_COMMAND_RESULT_EXPIRED);
    expect_alike(late, before, 3);
    protocol::Command foreign = command;
    foreign.boot_id = BareCore::kBootId + 1;
    EXPECT_EQ(elsewhere.order(foreign).result, rheonaut_COMMAND_RESULT_OTHER_BOOT);
    expect_alike(elsewhere, before, 3);
    protocol::Command repeated = command;
    repeated.command_id = ack.command_id;
    EXPECT_EQ(twice.order(repeated).result, rheonaut_COMMAND_RESULT_DUPLICATE);
    expect_alike(twice, after, 3);
  }
}

TEST_P(EveryState, MeetsEachEventAsThePageSays) {
  const PageTable table = page_table("event");
  ASSERT_EQ(names_of(table), names_of(kEventCases));
  for (const EventCase& each : kEventCases) {
    const PageRow row = table.at(each.name);
    const std::string cell = row.cells.at(GetParam().state);
    SCOPED_TRACE(each.name + std::string(" in ") + GetParam().name + ": " + cell);
    const BareCore before = in_state(each.parameters);
    BareCore after = before;
    each.happen(after);
    expect_transition(row, cell, before, after);
  }
}

INSTANTIATE_TEST_SUITE_P(Page, EveryState, ::testing::ValuesIn(kStateCases),
                         [](const auto& each) { return std::string(each.param.name); });

TEST(ModeTable, ALaterStopHidesASensorsCauseButDoesNotForgetIt) {
  BareCore core;
  core.order(sim_robot::set_auto(0.05F));
  core.accelerometer_answers = false;
  core.run(25);
  core.order(sim_robot::emergency_stop());
  core.tick();
  EXPECT_EQ(core.sample.emergency_cause, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  EXPECT_EQ(state_of(core), "sensor");
  core.accelerometer_answers = true;
  core.run(100);
  EXPECT_EQ(state_of(core), "recovered");
  core.order(sim_robot::clear_emergency(core.robot.emergency_id()));
  core.order(sim_robot::emergency_stop());
  core.tick();
  EXPECT_EQ(state_of(core), "emergency") << "a clear forgets it";
}

TEST(ModeTable, AClearOutsideTheLimitsLeavesTheRobotOutside) {
  const auto outside = [](const StateCase& each) { return each.state == std::string("outside"); };
  BareCore core = prepared(*std::find_if(kStateCases.begin(), kStateCases.end(), outside), {});
  core.order(sim_robot::emergency_stop());
  core.tick();
  EXPECT_EQ(state_of(core), "emergency");
  core.order(sim_robot::clear_emergency(core.robot.emergency_id()));
  core.tick();
  EXPECT_EQ(state_of(core), "outside");
}

TEST(ModeTable, HasAStateOfThePageForEveryColumn) {
  for (const char* kind : {"command", "event"}) {
    for (const auto& [name, row] : page_table(kind)) {
      for (const auto& [state, cell] : row.cells) {
        EXPECT_TRUE(std::any_of(kStateCases.begin(), kStateCases.end(), [&, column = state](const StateCase& each) {
          return column == each.state;
        })) << state;
      }
    }
  }
}

TEST(ModeTable, KnowsEveryActionOfTheProtocolInEveryMode) {
  for (pb_size_t action = rheonaut_Command_set_mode_tag; action <= rheonaut_Command_drop_timed_tag; ++action) {
    bool tried = false;
    const BareCore core;
    for (const CommandCase& each : kCommandCases) tried = tried || each.command(core).which_action == action;
    EXPECT_TRUE(tried) << action;
  }
  for (const auto mode : {rheonaut_MODE_MANUAL, rheonaut_MODE_AUTO, rheonaut_MODE_EMERGENCY}) {
    EXPECT_EQ(refusal_in(mode, rheonaut_Command_drop_timed_tag + 1), rheonaut_REJECT_REASON_UNSUPPORTED);
  }
}

}  // namespace
}  // namespace robot_fw
