// A story of a robot, a bad network and the least of a station: the words of story_words.hpp, and those of misfortune.
//
//   class Outage : public ::testing::Test, protected Story {};
//   TEST_F(Outage, StopsTheMotor) {
//     begin();
//     start_driving(0.3);
//     outage(2);
//     await(in_truth(motor_off()), {.limit_s = 0.5});
//   }
// Both ends in one process, without sockets or sleeps: a minute takes some hundredths of a second.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <tuple>

#include "sim_robot/lab/lab.hpp"
#include "tests/sim_robot/story_words.hpp"

namespace sim_robot {

struct Setting {
  SimulatedRobotConfig robot{};
  LinkOptions link{};
  std::vector<TimedFault> faults{};
  std::uint32_t samples_per_frame = 0;  // 1 to 25; 0: as the robot has it
};

class Story : public StoryWords {
 public:
  // A new robot in this setting, connected, its first sample received.
  void begin(Setting setting = {}, Where where = Where::current());

  // From now on.
  void suffer(const Fault& fault);
  void outage(double for_s);
  void impair_link(const Impairment& both_ways);
  void reboot(const Reboot& reboot = {});

  // Nothing of this boot is lost, 2.5 s from now.
  void expect_whole(Where where = Where::current());

  Moment moment() const override;
  protocol::Status status() const;  // the newest; all 0 before the first

  // Both ends and the network, for what has no word here.
  Lab& lab() { return *lab_; }
  const Lab& lab() const { return *lab_; }
  RobotLife& robot() { return lab_->robot; }
  ImpairedLink& link() { return lab_->link; }
  LinkedPeer& station() { return lab_->station; }

 private:
  void step() override;
  std::uint64_t give(const protocol::Command& command) override;
  std::optional<Answer> answer_to(std::uint64_t command_id) const override;
  void hear_news();
  View received() const;

  std::unique_ptr<Lab> lab_;
  std::size_t events_heard_ = 0;  // of the station's
  // By boot, event_seq and time: one may come twice after a reconnect.
  std::set<std::tuple<std::size_t, std::uint64_t, std::uint64_t>> known_events_;
};

}  // namespace sim_robot
