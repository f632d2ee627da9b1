// The recorded past of a robot that the station needs before the Welcome; the recorder implements it.
#pragma once

#include <boost/asio/awaitable.hpp>

#include "server/config/link_settings.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

struct AdmissionRequest {
  RobotId robot_id;
  std::string token;
  bool from_loopback = false;
  BootId boot_id = 0;
  protocol::ResetCause reset_cause = rheonaut_RESET_CAUSE_UNKNOWN;
  std::string firmware_version;
  std::uint32_t sample_period_us = 0;
  std::uint64_t robot_time_us = 0;
  std::uint64_t oldest_seq = 0;
  std::uint64_t next_seq = 0;
  std::uint64_t oldest_event_seq = 0;
  std::uint64_t next_event_seq = 0;
  std::uint64_t acknowledged_next_seq = 0;  // by any station; 0: the robot does not say
  std::uint64_t acknowledged_next_event_seq = 0;
  std::int64_t received_at_us = 0;  // UTC
};

struct Admission {
  protocol::RefusalReason refusal = rheonaut_REFUSAL_REASON_NONE;
  std::string detail;
  bool newly_enrolled = false;
  bool enrolment_full = false;  // the refusal: LoopbackEnrolment allows no other now
  std::uint64_t store_id = 0;
  std::uint64_t durable_next_seq = 0;  // the first sample of this boot that is neither stored nor known lost
  std::uint64_t durable_next_event_seq = 0;
};

// A robot of the archive, as the station knows it again after a restart.
struct RestoredRobot {
  RobotId id;
  BootId boot_id = 0;              // its latest; 0: none is known
  std::uint64_t emergency_id = 0;  // the latch it was last known to be in; 0: none
  std::int64_t retired_at_us = 0;  // UTC; 0: in use
  std::string fluid = {};          // that was named last; empty: none
  std::string moves_for = {};      // whose command moved that boot last; empty: nobody's
};

class RobotArchive {
 public:
  virtual ~RobotArchive() = default;

  // Checks the robot's token, refuses a boot_id that was used by another boot (`boot_id_reused`: robot time or next_seq
  // lies before what is stored), remembers the boot, and returns what of it is stored.
  virtual boost::asio::awaitable<Admission> admit(AdmissionRequest request) = 0;
};

}  // namespace server::station
