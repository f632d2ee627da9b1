// Robots and their boots in the database: who may connect, what of a boot is stored, how a boot ends.
//
// Disk thread only. Uses the Database, which outlives it.
#pragma once

#include <cstdint>
#include <vector>

#include "server/recording/database.hpp"
#include "server/recording/interval_set.hpp"
#include "server/station/robot_archive.hpp"

namespace server {

// A boot as it is stored.
struct StoredBoot {
  std::int64_t key = 0;
  IntervalSet samples;  // stored or known lost
  IntervalSet events;
  std::uint64_t next_seq = 0;  // every sample below was made
  std::uint64_t last_robot_time_us = 0;
};

struct AdmissionOutcome {
  Admission admission;
  StoredBoot boot;  // only when not refused
};

// A robot has connected with this boot.
struct BootStart {
  RobotId robot_id;
  std::int64_t boot_key = 0;
  std::uint64_t announced_next_seq = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t noticed_at_us = 0;  // UTC
};

class BootStore {
 public:
  explicit BootStore(Database& database) : database_{database} {}

  // Every robot, with its latest boot and the latch that boot was last known to be in.
  std::vector<RestoredRobot> robots();

  // Checks robot, token and boot; remembers a new robot or boot, durably. With `with_intervals` false, what is stored
  // of the boot is not read (the recorder has it in memory).
  AdmissionOutcome admit(const AdmissionRequest& request, bool enrol_on_loopback, bool with_intervals);

  // Inside the caller's transaction: ends the robot's other boots (what is missing of them is lost: `reboot`), and lets
  // its open run go on in this one.
  void start(const BootStart& start);

 private:
  Admission check_robot(const AdmissionRequest& request, bool enrol_on_loopback);
  std::uint64_t last_emergency(std::int64_t boot_key);
  std::int64_t remember_boot(const AdmissionRequest& request);
  StoredBoot load(std::int64_t boot_key, bool with_intervals);
  void end(std::int64_t boot_key, std::int64_t noticed_at_us);

  Database& database_;
};

}  // namespace server
