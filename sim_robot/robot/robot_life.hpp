// A simulated robot over its boots, in true time: reboots, brown-outs, a clock that drifts or jumps, a loop that
// blocks.
//
// Owns the robot, its clock and the two memories that outlive a boot: the storage of parameters and controller, and the
// latch. The plant runs through reboots, without a motor while the robot is off.
//   robot clock = at the last change + (true time since) · (1 + drift)
// True time is the time of the network and the station; advance_to() gets it, and nothing reads a clock. A tick
// runs when the robot's own clock has reached its time, so a fast clock ticks more often.
#pragma once

#include <map>
#include <vector>

#include "robot_fw/core/settings_store.hpp"
#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {

struct Reboot {
  protocol::ResetCause cause = rheonaut_RESET_CAUSE_SOFTWARE;
  double off_for_s = 0.5;     // reset, boot and Wi-Fi
  bool keeps_latch = true;    // the memory for it survives; after power was gone it does not
  bool keeps_storage = true;  // the flash is not erased
};

// Totals of the boots before this one; a reset loses the samples in its ring.
struct EarlierBoots {
  std::uint64_t samples_made = 0, samples_lost = 0, commands = 0, missed_ticks = 0;
};

class RobotLife {
 public:
  explicit RobotLife(SimulatedRobotConfig config);

  // Runs the ticks that are due up to a true time.
  void advance_to(std::uint64_t true_us);

  // Switches off now, then on again with another boot id, which is derived from the one before.
  void reboot(const Reboot& reboot);
  // Blocks the loop for so long, as a TLS handshake does: ticks are missed. A longer present block stays.
  void block(double for_s);
  void unblock();                // ends every block
  void drift(double ppm);        // of the robot's clock against true time, from now on
  void jump_clock(double by_s);  // the clock alone

  // When the next tick is due in true time, or the robot is back.
  std::uint64_t next_tick_us() const;

  bool is_on() const { return true_us_ >= on_at_us_; }
  bool is_blocked() const { return !is_on() || true_us_ < free_at_us_; }
  int boots() const { return boots_; }
  const EarlierBoots& earlier_boots() const { return earlier_; }
  std::uint64_t lost_at_reboot() const { return lost_at_reboot_; }  // samples, at the last one
  std::uint64_t true_us() const { return true_us_; }
  std::uint64_t robot_clock_us() const;  // never before the last tick
  SimulatedRobot& robot() { return robot_; }
  const SimulatedRobot& robot() const { return robot_; }
  const robot_fw::Robot& core() const { return robot_.core(); }

 private:
  // The flash.
  class Storage final : public robot_fw::Storage {
   public:
    std::size_t load(robot_fw::StorageKey key, std::uint8_t* bytes, std::size_t capacity) override;
    bool save(robot_fw::StorageKey key, protocol::Bytes bytes) override;
    void erase() { values_.clear(); }

   private:
    std::map<robot_fw::StorageKey, std::vector<std::uint8_t>> values_;
  };

  void archive_boot();
  SimulatedRobotConfig with_storage(SimulatedRobotConfig config);
  void keep_clock();
  double clock_us() const;

  Storage storage_;
  SimulatedRobot robot_;
  std::uint64_t true_us_ = 0;
  std::uint64_t on_at_us_ = 0, free_at_us_ = 0;
  std::uint64_t coasted_to_us_ = 0;  // while off
  int boots_ = 1;
  EarlierBoots earlier_;
  std::uint64_t lost_at_reboot_ = 0;
  double clock_rate_ = 1;           // of the robot's clock
  double clock_base_us_ = 0;        // what it showed
  std::uint64_t true_base_us_ = 0;  // then
};

}  // namespace sim_robot
