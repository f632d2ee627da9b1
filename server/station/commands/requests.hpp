// Requests of people and scripts to the station: a command, an emergency stop, control of a robot.
//
// Plain values. An actor is a session of a page ("session:3") or a token ("token:local").
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

inline constexpr microseconds kControlLease{3'000'000};      // after the holder's last sign of life
inline constexpr microseconds kLongestControl{600'000'000};  // that a script may ask for
// What the station asks by itself may be answered so long after its life: a late answer is no reason to give up.
inline constexpr microseconds kOwnAnswerGrace{1'000'000};
inline constexpr microseconds kOldestSight{400'000};  // of what a page has seen, to take or keep anything
inline bool is_fresh(microseconds age) { return age >= microseconds{0} && age <= kOldestSight; }

// A request to command a robot. `action` has its action member set; the station fills id, boot and validity.
struct CommandRequest {
  RobotId robot_id;
  protocol::Command action = rheonaut_Command_init_zero;
  std::string arguments = "{}";  // as JSON, for the record
  std::string actor;
  std::string client;                    // its id, see Client
  std::string peer;                      // the address that it came from
  microseconds time_to_live{2'000'000};  // at most 10 s, from when it was issued
  microseconds answer_grace{50'000};     // the robot's answer may come so long after it; then it is unknown
  microseconds age{0};                   // it was issued so long before it arrived
  std::string life_from = "arrival";     // how that is known, see CommandRecord
  microseconds unread{0};                // the station stood still: it may have waited for so long before it was read
  std::string key;               // of the client, new for each command; a request that is repeated sends nothing
  std::int64_t received_us = 0;  // steady, when it arrived at the station; 0: now
  bool until_verified = false;   // wait for more than the robot's answer
  bool takes_control = true;     // of a robot that nobody controls
};

struct StopRequest {
  RobotId robot_id;
  std::string actor;
  std::string peer;              // as above
  std::string key;               // as above: one press may come by two ways
  std::int64_t received_us = 0;  // as above
};

struct StopsOfAll {
  std::vector<CommandRecord> records;
  std::vector<RobotId> failed;    // the station could not take their stop; its log says why
  std::vector<RobotId> left_out;  // retired and not connected
};

enum class ControlAction : std::uint8_t { take, force, release, request, hand_over };

struct ControlRequest {
  RobotId robot_id;
  std::string actor;
  std::string peer;  // the address that it came from
  ControlAction action = ControlAction::take;
  microseconds lease{kControlLease};       // take: without a sign of life; at most kLongestControl
  std::string reason;                      // force: why
  microseconds age{0};                     // take, force: of what its page saw; above kOldestSight it begins nothing
  std::string client{};                    // its id, see Client
  std::optional<std::string> orders_of{};  // take: what waits on the robot of this client of the actor goes on
};

}  // namespace server::station
