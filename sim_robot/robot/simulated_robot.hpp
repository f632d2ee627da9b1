// A robot without hardware: the firmware core in a simulated world, stepped in virtual time, without sockets.
//
// robot_time_us() is the time of the next tick. A tick reads the sensors at that time; the duty that comes out of it
// acts on the world for the whole period that follows.
#pragma once

#include <string>

#include "robot_fw/core/robot.hpp"
#include "sim_robot/world/world.hpp"

namespace sim_robot {

struct SimulatedRobotConfig {
  std::string robot_id = "sim-1";
  std::string token;
  std::uint64_t boot_id = 1;  // random in earnest, see random_boot_id()
  protocol::ResetCause reset_cause = rheonaut_RESET_CAUSE_POWER_ON;
  robot_fw::DutyRange duty{-1, 1};
  std::uint32_t samples_per_frame = 5;  // 1 to 25; the station may ask for another
  WorldConfig world;
  double clock_drift_ppm = 0;               // of its clock against true time, see robot_life; fast is positive
  robot_fw::Storage* storage = nullptr;     // of parameters and controller; null: they end with the robot
  std::uint64_t restored_emergency_id = 0;  // a latch that outlived the reset; 0: none
  protocol::EmergencyCause restored_emergency_cause = rheonaut_EMERGENCY_CAUSE_NONE;
};

// Throws std::invalid_argument, quoting the value, for an invalid name, token, boot id, duty range or world.
void check(const SimulatedRobotConfig& config);

// Never 0, never from a seed.
std::uint64_t random_boot_id();
// From 1 to 16 hexadecimal digits, with or without 0x; throws std::invalid_argument.
std::uint64_t parse_boot_id(const std::string& text);

class SimulatedRobot {
 public:
  static constexpr std::uint64_t kPeriodUs = 10'000;
  static constexpr double kPeriodS = kTickS;
  static constexpr std::uint64_t kMaxLatenessUs = 50'000;

  explicit SimulatedRobot(SimulatedRobotConfig config);
  SimulatedRobot(const SimulatedRobot&) = delete;  // the core points into the config
  SimulatedRobot& operator=(const SimulatedRobot&) = delete;

  void step();  // one tick of kPeriodS
  // Prefetches the memory of the next tick: many robots do not fit a cache.
  void prefetch() const;

  // Lets robot time reach `now_us`: afterwards no tick is due. Ticks that are up to kMaxLatenessUs late run one by one,
  // each at its own time. After a longer stall only the latest one runs; those before it are skipped.
  void advance_to(std::uint64_t now_us);
  // Time passes without ticks: the motor keeps the duty it has for 50 ms and is off then, as on the robot's board; the
  // core sees nothing but the later time.
  void skip(std::uint64_t ticks);
  // As advance_to(), with a blocked loop: ticks that are over kMaxLatenessUs late, and those after them, are skipped;
  // so when the loop goes on only the latest one runs.
  void idle_to(std::uint64_t now_us);

  // For sim_robot/robot/robot_life. A reset restarts the core at robot time 0 with the boot, cause, duty, storage and
  // latch of `config`; plant and sensors go on.
  void reset(const SimulatedRobotConfig& config);
  void coast(std::uint64_t ticks);      // without power: the plant alone, robot time stands still
  void jump_clock(std::int64_t by_us);  // robot time alone; back to 0 at most

  // As of the core; times are robot times, see robot_fw/core/robot.hpp.
  void link_opened(std::uint64_t now_us) { core_.link_opened(now_us); }
  void link_closed(std::uint64_t now_us) { core_.link_closed(now_us); }
  bool receive(protocol::Bytes bytes, std::uint64_t now_us) { return core_.receive(bytes, now_us); }
  std::size_t transmit(std::uint8_t* out, std::size_t capacity, std::uint64_t now_us) {
    return core_.transmit(out, capacity, now_us);
  }

  const robot_fw::Robot& core() const { return core_; }
  const World& world() const { return world_; }
  World& world() { return world_; }  // for faults, flow and glucose while it runs
  const SimulatedRobotConfig& config() const { return config_; }
  std::uint64_t robot_time_us() const { return robot_time_us_; }
  std::uint32_t missed_ticks() const { return missed_ticks_; }
  double motor_duty() const { return motor_duty_; }  // what the world feels, also while ticks are skipped

 private:
  SimulatedRobotConfig config_;
  robot_fw::Robot core_;
  World world_;
  std::uint64_t robot_time_us_ = 0;
  std::uint32_t missed_ticks_ = 0;
  std::uint64_t skipped_ = 0;  // in a row
  double motor_duty_ = 0;
};

}  // namespace sim_robot
