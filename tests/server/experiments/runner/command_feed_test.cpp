// The commands of a time line: their times, how many wait, changes of mode, schedules that follow each other.
#include "server/experiments/runner/command_feed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "server/experiments/profile_document.hpp"

namespace server::experiments {
namespace {

constexpr std::uint64_t kBegin_us = 7'003'000;  // between two ticks

TimeLine line_of(const std::string& toml) {
  return time_line_of(parse_profile("name = \"a\"\npurpose = \"b\"\n" + toml, "test"), {});
}

std::string duty_step(const std::string& kind, const std::string& more) {
  return "[[step]]\nkind = \"" + kind + "\"\n" + more + "\n";
}

struct Sent {
  std::uint64_t at_us = 0;  // when it was given out
  FedCommand fed;
};

// All of it, as a robot that is looked at every 10 ms sees it.
std::vector<Sent> all_of(CommandFeed& feed, std::uint64_t until_us) {
  std::vector<Sent> sent;
  for (std::uint64_t now_us = kBegin_us - 500'000; now_us < until_us; now_us += 10'000) {
    while (auto fed = feed.next(now_us)) sent.push_back({now_us, *fed});
  }
  return sent;
}

// What the motor does, tick by tick, if each schedule replaces the one before it.
std::map<std::uint64_t, float> duties_of(const std::vector<Sent>& sent) {
  std::map<std::uint64_t, float> duties;  // from this tick on
  for (const Sent& one : sent) {
    if (one.fed.command.which_action != rheonaut_Command_set_duty_schedule_tag) continue;
    const auto& order = one.fed.command.action.set_duty_schedule;
    const std::uint64_t first = (one.fed.command.execute_at_robot_us - kBegin_us) / 10'000;
    duties.erase(duties.lower_bound(first), duties.end());
    for (pb_size_t i = 0; i < order.tick_count; ++i) duties[first + order.tick[i]] = order.duty[i];
  }
  return duties;
}

TEST(CommandFeed, GivesEachCommandOutShortlyBeforeItsTime) {
  const TimeLine line = line_of(duty_step("setpoint", "setpoint_m = 0.1\nfor_s = 2") +
                                duty_step("disturbance", "disturbance_m = -0.05\nfor_s = 1"));
  CommandFeed feed{line, 0, kBegin_us};
  const std::vector<Sent> sent = all_of(feed, kBegin_us + 4'000'000);
  ASSERT_EQ(sent.size(), 2U);
  EXPECT_EQ(sent[0].fed.command.which_action, rheonaut_Command_set_mode_tag);
  EXPECT_EQ(sent[0].fed.command.execute_at_robot_us, kBegin_us);
  EXPECT_EQ(sent[1].fed.command.which_action, rheonaut_Command_inject_disturbance_tag);
  EXPECT_EQ(sent[1].fed.command.execute_at_robot_us, kBegin_us + 2'000'000);
  for (const Sent& one : sent) {
    EXPECT_LE(one.fed.command.execute_at_robot_us - one.at_us, kLookAheadUs);
    EXPECT_GT(one.fed.command.execute_at_robot_us - one.at_us, kLookAheadUs - 20'000);
  }
  EXPECT_EQ(feed.mode_at(kBegin_us - 1), rheonaut_MODE_MANUAL);
  EXPECT_EQ(feed.mode_at(kBegin_us), rheonaut_MODE_AUTO);
  EXPECT_FALSE(feed.is_over(kBegin_us + 2'999'000));
  EXPECT_TRUE(feed.is_over(kBegin_us + 3'000'000));
}

TEST(CommandFeed, SchedulesThatFollowEachOtherMakeTheWholeSignal) {
  const TimeLine line = line_of(duty_step("rest", "for_s = 1") +
                                duty_step("chirp", "amplitude = 0.5\nfrom_hz = 0.2\nto_hz = 2\nfor_s = 20") +
                                duty_step("rest", "for_s = 1"));
  ASSERT_GT(line.actions.size(), 300U);
  CommandFeed feed{line, 0, kBegin_us};
  const auto sent = all_of(feed, kBegin_us + 23'000'000);
  ASSERT_GT(sent.size(), 4U);
  const auto duties = duties_of(sent);
  float wanted = 0;
  auto action = line.actions.begin();
  for (std::uint64_t tick = 0; tick <= line.ticks; ++tick) {
    for (; action != line.actions.end() && action->tick <= tick; ++action) wanted = static_cast<float>(action->value);
    const auto after = duties.upper_bound(tick);
    const float given = after == duties.begin() ? 0 : std::prev(after)->second;
    ASSERT_EQ(given, wanted) << "tick " << tick;
  }
  for (const Sent& one : sent) {
    const auto& order = one.fed.command.action.set_duty_schedule;
    ASSERT_LE(order.tick_count, 64U);
    EXPECT_EQ(order.duty[order.duty_count - 1], 0) << "SAFETY: the last entry is 0";
  }
}

TEST(CommandFeed, AChangeOfModeLetsNothingWaitBehindIt) {
  const TimeLine line =
      line_of(duty_step("duty", "duty = 0.3\nfor_s = 1") + duty_step("setpoint", "setpoint_m = 0.1\nfor_s = 0.1") +
              duty_step("duty", "duty = -0.2\nfor_s = 1"));
  CommandFeed feed{line, 0, kBegin_us};
  const auto sent = all_of(feed, kBegin_us + 6'000'000);
  std::vector<pb_size_t> kinds;
  std::uint64_t changes_at_us = 0;
  for (const Sent& one : sent) {
    kinds.push_back(one.fed.command.which_action);
    EXPECT_GE(one.at_us, changes_at_us) << "the robot drops what waits when its mode changes";
    if (one.fed.command.which_action == rheonaut_Command_set_mode_tag)
      changes_at_us = one.fed.command.execute_at_robot_us;
  }
  const std::vector<pb_size_t> wanted{rheonaut_Command_set_duty_schedule_tag, rheonaut_Command_set_mode_tag,
                                      rheonaut_Command_set_mode_tag, rheonaut_Command_set_duty_schedule_tag};
  EXPECT_EQ(kinds, wanted);
  EXPECT_EQ(sent[3].fed.command.execute_at_robot_us, sent[2].fed.command.execute_at_robot_us + 500'000);
}

TEST(CommandFeed, NeverMoreWaitThanTheRobotHolds) {
  const TimeLine line = line_of(duty_step("scan", "setpoint_m = 0.2\nvelocity_m_s = 0.1"));
  CommandFeed feed{line, 0, kBegin_us};
  const auto sent = all_of(feed, kBegin_us + 4'000'000);
  EXPECT_EQ(sent.size(), 41U) << "the beginning, and every 50 ms for 2 s";
  for (const Sent& one : sent) {
    const auto waiting = std::ranges::count_if(sent, [&one](const Sent& other) {
      return other.at_us <= one.at_us && other.fed.command.execute_at_robot_us >= one.at_us;
    });
    EXPECT_LE(waiting, 4) << one.at_us;
    EXPECT_GE(one.fed.command.execute_at_robot_us, one.at_us) << "none is late";
  }
}

TEST(CommandFeed, NeedsALeaseWhileADutyRunsOrWaits) {
  const TimeLine line = line_of(duty_step("rest", "for_s = 1") + duty_step("duty", "duty = 0.3\nfor_s = 1") +
                                duty_step("rest", "for_s = 3"));
  CommandFeed feed{line, 0, kBegin_us};
  EXPECT_FALSE(feed.needs_lease(kBegin_us));
  EXPECT_FALSE(feed.next(kBegin_us)) << "it is at rest already";
  EXPECT_FALSE(feed.is_about_to_drive(kBegin_us + 500'000));
  EXPECT_TRUE(feed.is_about_to_drive(kBegin_us + 700'000));
  ASSERT_TRUE(feed.next(kBegin_us + 700'000));
  EXPECT_TRUE(feed.needs_lease(kBegin_us + 700'000));
  EXPECT_TRUE(feed.needs_lease(kBegin_us + 1'900'000));
  EXPECT_FALSE(feed.needs_lease(kBegin_us + 5'100'000));
}

TEST(CommandFeed, AStepIsRepeatedFromWhereTheRobotCanBeginIt) {
  const TimeLine line =
      line_of(duty_step("duty", "duty = 0.3\nfor_s = 1") + duty_step("duty", "duty = 0.1\nfor_s = 1") +
              duty_step("setpoint", "setpoint_m = 0.1\nfor_s = 2") +
              duty_step("disturbance", "disturbance_m = -0.05\nfor_s = 1") +
              duty_step("scan", "setpoint_m = 0.2\nvelocity_m_s = 0.1") + duty_step("duty", "duty = 0.1\nfor_s = 1"));
  const std::vector<std::size_t> wanted{0, 1, 2, 2, 2, 5};
  for (std::size_t step = 0; step < wanted.size(); ++step) EXPECT_EQ(step_to_repeat(line, step), wanted[step]) << step;
  CommandFeed feed{line, 2, kBegin_us};
  const auto first = feed.next(kBegin_us);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->command.which_action, rheonaut_Command_set_mode_tag);
  EXPECT_EQ(first->command.execute_at_robot_us, kBegin_us);
}

TEST(CommandFeed, WhatIsLeftBeginsWithTheDutyInForce) {
  const TimeLine line = line_of(duty_step("duty", "duty = 0.3\nfor_s = 10") + duty_step("rest", "for_s = 2"));
  const TimeLine rest = rest_of(line, 0, 400);
  ASSERT_EQ(rest.actions.size(), line.actions.size());
  EXPECT_EQ(rest.actions.front(), (Action{0, ActionKind::duty, 0.3, 0}));
  EXPECT_EQ(rest.ticks, line.ticks - 400);
  EXPECT_EQ(rest.step_begins, (std::vector<std::uint64_t>{0, 600}));
  EXPECT_FALSE(duty_in_force(line, 0, 0)) << "it is set there";
  EXPECT_FALSE(duty_in_force(line, 1, 1100)) << "the motor is off";
}

TEST(CommandFeed, GoesOnAtATick) {
  TimeLine line = line_of(duty_step("duty", "duty = 0.3\nfor_s = 10"));
  line.actions.insert(line.actions.begin() + 1, *duty_in_force(line, 0, 400));
  CommandFeed feed{line, 0, kBegin_us, 400};
  const auto sent = all_of(feed, kBegin_us + 8'000'000);
  const auto duties = duties_of(sent);
  EXPECT_EQ(duties.begin()->first, 0U);
  EXPECT_FLOAT_EQ(duties.begin()->second, 0.3F);
  EXPECT_EQ(duties.rbegin()->first, 600U) << "what was left of it";
  EXPECT_EQ(duties.rbegin()->second, 0);
}

}  // namespace
}  // namespace server::experiments
