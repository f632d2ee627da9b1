// Robots and their boots in the database: who may connect, what of a boot is stored, how a boot ends.
//
// Disk thread only. Uses the Database, which outlives it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/station/state/robot_archive.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/samples/interval_set.hpp"

namespace server::storage {

// A boot as it is stored.
struct StoredBoot {
  std::int64_t key = 0;
  IntervalSet samples;   // stored or known lost
  IntervalSet given_up;  // of those
  IntervalSet events;
  std::uint64_t next_seq = 0;        // every sample below was made
  std::uint64_t next_event_seq = 0;  // every event below was made
  std::uint64_t last_robot_time_us = 0;
  std::int64_t connected_at_us = 0;  // UTC, the latest time; 0: never
};

// Samples that nobody expects any more are gaps of this cause: their robot did not come back with them.
inline constexpr const char* kGivenUp = "given_up";

// A robot asks to be let in. `owner` is the robot that the recorder knows the boot of; without one the boot is looked
// for, and what is stored of it is read.
struct AdmissionQuestion {
  station::AdmissionRequest request;
  std::optional<station::RobotId> owner;
};

struct AdmissionOutcome {
  station::Admission admission;
  StoredBoot boot;  // key 0: it was refused, is not known here, or was not looked for
};

// A boot that was admitted for the first time; the recorder has numbered it.
struct NewBoot {
  std::int64_t boot_key = 0;
  station::AdmissionRequest hello;
};

// How far a boot is recorded once a commit is durable.
struct BootProgress {
  std::int64_t boot_key = 0;
  std::uint64_t durable_next_seq = 0;  // every sample below is stored or known lost
  std::uint64_t durable_next_event_seq = 0;
  std::uint64_t last_robot_time_us = 0;  // of a stored sample
};

// A robot has connected with this boot.
struct BootStart {
  station::RobotId robot_id;
  std::int64_t boot_key = 0;
  std::uint64_t announced_next_seq = 0;
  std::uint64_t announced_next_event_seq = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t noticed_at_us = 0;  // UTC
};

station::Admission refusal(protocol::RefusalReason reason, std::string detail);

// The refusal of a boot_id that is another robot's.
station::Admission reused(const station::AdmissionRequest& request, const station::RobotId& owner);

// The refusal of a robot whose enrolment was revoked.
station::Admission revoked(const station::RobotId& robot_id);

class BootStore {
 public:
  explicit BootStore(Database& database) : database_{database} {}

  // Every robot, with its latest boot and the latch that boot was last known to be in.
  std::vector<station::RestoredRobot> robots();

  // The next new boot gets this key. Keys are given in the order of admission and never twice.
  std::int64_t next_boot_key();

  // Checks robot and token of each, and whose boot it is; remembers new robots, durably and in one transaction, and
  // writes nothing else, so a full disk still admits robots that are enrolled. Does not throw: who cannot be answered
  // is refused as STATION_BUSY. One outcome for each question, in order.
  std::vector<AdmissionOutcome> admit(const std::vector<AdmissionQuestion>& questions,
                                      const config::LoopbackEnrolment& enrolment);

  // The boot as it is stored; key 0: it is not this robot's.
  StoredBoot find(const station::RobotId& robot_id, station::BootId boot_id);

  // Inside the caller's transaction: these boots are known from now on.
  void add(const std::vector<NewBoot>& boots);

  // Inside the caller's transaction: the fluid that the robot is in; empty: not known.
  void set_fluid(const station::RobotId& robot_id, const std::string& fluid);

  // Inside the caller's transaction: ends the robot's other boots (what is missing of them is lost: `reboot`, or
  // `restore` if nothing was received since), and lets its open run go on in this one.
  void start(const BootStart& start);

 private:
  std::vector<AdmissionOutcome> admit_together(std::span<const AdmissionQuestion> questions,
                                               const config::LoopbackEnrolment& enrolment);
  AdmissionOutcome admit_one(const AdmissionQuestion& question, const config::LoopbackEnrolment& enrolment);
  station::Admission check_robot(const station::AdmissionRequest& request, const config::LoopbackEnrolment& enrolment);
  std::optional<station::Admission> check_room(const station::AdmissionRequest& request,
                                               const config::LoopbackEnrolment& enrolment);
  void note_enrolled(const station::AdmissionRequest& request);
  std::uint64_t latch_of(const station::RobotId& robot_id);
  std::string mover_of(const station::RobotId& robot_id, station::BootId boot_id);
  std::optional<std::uint64_t> last_emergency(std::int64_t boot_key);  // empty: nothing of it is stored
  StoredBoot load(std::int64_t boot_key);
  void end(std::int64_t boot_key, std::int64_t noticed_at_us);

  Database& database_;
};

}  // namespace server::storage
