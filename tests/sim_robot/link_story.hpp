// A robot, a bad network and the least of a station, for tests that tell a story in virtual time.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>

#include "sim_robot/lab/linked_peer.hpp"
#include "sim_robot/lab/station_commands.hpp"
#include "sim_robot/scenario/fault_timeline.hpp"

namespace sim_robot {

class LinkStory : public ::testing::Test {
 protected:
  // Begins, and waits for the first sample.
  void begin(const LinkOptions& options = {}) {
    link.emplace(life, options);
    station.emplace(*link);
    ASSERT_TRUE(run_until([&] { return !station->samples.empty(); }, 10));
  }

  template <class Condition>
  bool run_until(Condition condition, double limit_s) {
    const double end_s = now_s() + limit_s;
    while (!condition() && now_s() < end_s) step();
    return condition();
  }
  // As the station's, with the faults by time.
  void step() {
    link->exchange();
    faults.advance(faulty(), life.true_us() + ImpairedLink::kStepUs);
    link->exchange();
    station->serve();
  }
  void run_to(double time_s) {
    while (now_s() < time_s - 0.005) step();
  }
  FaultyRobot faulty() { return {life, &*link}; }
  // Seconds until the condition holds; the limit when it does not.
  template <class Condition>
  double time_to(Condition condition, double limit_s) {
    const double begin_s = now_s();
    EXPECT_TRUE(run_until(condition, limit_s));
    return now_s() - begin_s;
  }
  // Manual at a duty, under a lease that is renewed while this runs; seconds until the motor is off.
  double drive_until_it_stops(float duty, double limit_s) {
    const double begin_s = now_s();
    station->send(set_duty(duty));
    EXPECT_TRUE(run_until([&] { return core().duty() != 0; }, 2));
    while (core().duty() != 0 && now_s() < begin_s + limit_s) {
      station->run(0.1);
      station->send(renew_lease());
    }
    return now_s() - begin_s;
  }
  std::string answer(std::uint64_t command_id) const {
    const auto ack = station->ack_of(command_id);
    if (!ack) return "none";
    return ack->result == rheonaut_COMMAND_RESULT_REJECTED ? protocol::text(ack->reason) : protocol::text(ack->result);
  }
  bool reached_auto(float setpoint_m) {
    station->send(set_auto(setpoint_m));
    return run_until([&] { return core().mode() == rheonaut_MODE_AUTO && core().duty() != 0; }, 3);
  }
  bool caught_up() const {
    return station->link_is_up() && !station->samples.empty() &&
           station->durable_next_seq() >= station->hello->next_seq &&
           station->durable_next_seq() == station->samples.rbegin()->first + 1;
  }
  protocol::Status status() const {
    protocol::Status last = rheonaut_Status_init_zero;
    for (const auto& frame : station->frames) {
      if (frame.which_body == rheonaut_RobotFrame_status_tag) last = frame.body.status;
    }
    return last;
  }
  int events_of(protocol::EventKind kind) const {
    std::map<std::pair<std::uint64_t, std::uint64_t>, int> distinct;  // one may come twice after a reconnect
    for (const auto& event : station->events) {
      if (event.kind == kind) distinct[{event.event_seq, event.event_robot_time_us}] = 1;
    }
    return static_cast<int>(distinct.size());
  }
  // No sample of this boot is missing.
  void expect_whole() {
    station->run(2.5);  // the last batch, and a status
    EXPECT_TRUE(station->link_is_up());
    EXPECT_EQ(station->lost_samples(), 0u);
    EXPECT_EQ(status().lost_samples, 0u);
    ASSERT_FALSE(station->samples.empty());
    EXPECT_EQ(station->samples.size(), station->samples.rbegin()->first + 1);
    EXPECT_EQ(station->durable_next_seq(), station->samples.rbegin()->first + 1);
  }
  void expect_still() {
    EXPECT_EQ(core().duty(), 0);
    EXPECT_NE(core().mode(), rheonaut_MODE_AUTO);
  }

  double now_s() const { return 1e-6 * static_cast<double>(life.true_us()); }
  const robot_fw::Robot& core() const { return life.core(); }

  RobotLife life{{}};
  std::optional<ImpairedLink> link;
  std::optional<LinkedPeer> station;
  FaultTimeline faults;
};

}  // namespace sim_robot
