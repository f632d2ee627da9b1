// The values that flow through the station: the state of a robot, its samples, events and commands.
//
// Plain values, copied freely. Enumerators are those of the protocol; protocol::text() gives their JSON spelling.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "protocol/messages.hpp"
#include "server/station/state/reservation.hpp"
#include "server/station/state/telemetry_fields.hpp"

// In the namespace of the generated struct. Byte by byte, so that no field is forgotten and NaN equals NaN; padding, if
// there is any, may make a difference where there is none.
inline bool operator==(const rheonaut_Status& a, const rheonaut_Status& b) {
  using Bytes = std::array<std::byte, sizeof a>;
  return std::bit_cast<Bytes>(a) == std::bit_cast<Bytes>(b);
}

namespace server::station {

using RobotId = std::string;      // 1 to 31 characters of [a-z0-9_-]
using BootId = std::uint64_t;     // random per boot of a robot, never 0; a decimal string in JSON
using CommandId = std::uint64_t;  // random, never 0; a decimal string in JSON

// Consecutive samples of one boot, as they arrived in one frame.
struct SampleBatch {
  RobotId robot_id;
  BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t first_robot_time_us = 0;
  std::uint64_t oldest_seq = 0;  // the oldest the robot still held
  SampleContext context;
  std::vector<Sample> samples;
  std::int64_t received_at_us = 0;         // UTC
  std::int64_t utc_offset_us = 0;          // UTC = robot time + this, by the estimate at reception
  std::int64_t clock_uncertainty_us = -1;  // half-width of that estimate; -1: no estimate yet

  std::uint64_t next_seq() const { return first_seq + samples.size(); }
};

// An event of a robot (event_seq counts per boot) or of the station about a robot (no boot, no event_seq).
struct RobotEvent {
  RobotId robot_id;
  BootId boot_id = 0;
  std::optional<std::uint64_t> event_seq;
  std::uint64_t oldest_event_seq = 0;
  std::uint64_t robot_time_us = 0;
  std::uint64_t sample_seq = 0;
  std::string kind;            // the text of EventKind, or one of the station's own: docs/database.md lists them
  std::string cause = "none";  // of the event itself: the text of EventCause, of the station's own see there
  // Of the latch in force after the event. None: a version before schema 7 stored it in place of `cause`, when latched.
  std::optional<protocol::EmergencyCause> emergency_cause;
  std::string detail;                         // for people; the station's own
  std::optional<std::string> unknown_values;  // see unknown_values.hpp; also of kind and cause, which are text here
  protocol::Mode mode = rheonaut_MODE_UNSPECIFIED;
  protocol::SubState sub_state = rheonaut_SUB_STATE_NONE;
  float position_m = 0;
  float value = 0;
  std::uint64_t emergency_id = 0;
  CommandId command_id = 0;
  std::int64_t received_at_us = 0;  // UTC
};

// A stretch of time of one boot.
struct BootPart {
  BootId boot_id = 0;
  std::uint64_t from_robot_us = 0;
  double length_s = 0;
};

enum class LinkState : std::uint8_t { disconnected, connected };
const char* text(LinkState value);

// A robot's clock against the station's, for one boot. True at one moment, and less so the further a sample is from it.
struct ClockEstimate {
  bool valid = false;
  std::int64_t offset_us = 0;  // station steady time = robot time + offset_us
  std::int64_t bound_us = 0;   // of the error of offset_us, when it was measured
  std::uint64_t measured_at_robot_us = 0;
  double drift_ppm = 0;            // growth of offset_us in millionths; 0 before it is measured
  double most_drift_ppm = 0;       // its size is at most this
  std::int64_t round_trip_us = 0;  // of the latest exchange

  // Of offset_us, at this time of the robot: bound_us, and most_drift_ppm of the time from the measurement to it.
  std::int64_t uncertainty_us(std::uint64_t robot_time_us) const;
  bool operator==(const ClockEstimate&) const = default;
};

// Whether an emergency stop would reach the robot now, by probes that take its way: link/stop_probes.hpp.
struct StopPath {
  bool is_measured = false;         // false: not connected since the station started, or its firmware answers no probes
  bool is_open = false;             // a stop would arrive now
  std::int64_t round_trip_us = 0;   // of the latest answered probe; 0: none in this connection
  std::int64_t answered_at_us = 0;  // UTC
  bool operator==(const StopPath&) const = default;
};

// A clock estimate as it is recorded: once a minute, and whenever it or the station's own time has jumped.
struct ClockRecord {
  BootId boot_id = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_offset_us = 0;  // UTC = robot time + this
  std::int64_t uncertainty_us = 0;
  double drift_ppm = 0;
  std::int64_t round_trip_us = 0;
  std::int64_t station_step_us = 0;  // UTC was set by so much since the record before; 0: it was not
};

using ReportedParameters = std::map<std::string, rheonaut_Parameter>;  // by name
using InForceContent = std::variant<ReportedParameters, protocol::Controller>;

// What is in force on a robot from a sample of its boot on, until the next of its kind.
struct InForceRecord {
  BootId boot_id = 0;
  bool is_change = false;       // said later in a connection, and not to begin it
  std::uint64_t first_seq = 0;  // the first sample made after it was said
  InForceContent content;
  std::int64_t noticed_at_us = 0;  // UTC
};

// Who may command a robot now.
struct ControlState {
  std::string holder;            // an actor; empty: nobody, the next actor to command takes it
  std::int64_t taken_at_us = 0;  // UTC
  std::string requested_by;      // who has asked the holder for it; empty: nobody
  bool operator==(const ControlState&) const = default;
};

// A parameter that bounds the robot's motion and is not at its default.
struct ChangedLimit {
  std::string name, unit;
  float value = 0, default_value = 0;
  bool operator==(const ChangedLimit&) const = default;
};

// The model in a robot's estimator, and whether the station has sent it: station/models.
enum class ModelState : std::uint8_t {
  assumed,    // the robot's own word: nobody has said that its model is that of its fluid
  sending,    // on its way
  confirmed,  // the robot says so
  failed,     // it could not be sent, or one of another fluid not be taken back: `reason`
};
const char* text(ModelState value);

struct RobotModel {
  ModelState state = ModelState::assumed;
  std::string fluid;                // whose model is confirmed, or was to be; empty: of none that the station knows
  std::string reason;               // for people; may be empty
  std::optional<double> fit_error;  // of that model, a share of the final velocity
  std::int64_t set_at_us = 0;       // UTC, when that model was given to the station; 0: none
  bool operator==(const RobotModel&) const = default;
};

// All that is known of one robot now. Owned by Station; others get const access or a copy.
struct RobotState {
  RobotId id;
  LinkState link = LinkState::disconnected;
  std::string peer;                      // address, while connected
  std::int64_t connected_at_us = 0;      // UTC
  std::int64_t last_received_at_us = 0;  // UTC of the last frame
  std::int64_t last_received_steady_us = 0;

  BootId boot_id = 0;  // 0: never seen since the station started
  protocol::ResetCause reset_cause = rheonaut_RESET_CAUSE_UNKNOWN;
  std::string firmware_version;
  std::uint32_t sample_period_us = 0;
  std::uint32_t ring_capacity = 0;
  std::uint32_t parameters_checksum = 0;
  std::uint32_t controller_checksum = 0;

  SampleContext context;         // of the latest live batch (from Hello before the first)
  std::optional<Sample> sample;  // the latest
  std::string fluid;             // that it swims in, as Envelope lists it; empty: not known
  RobotModel model;              // of its fluid, in its estimator
  double at_power_s = 0;         // how long its motor has run above Envelope's power_duty, less the time it did not
  std::uint64_t next_seq = 0;    // after the latest sample received
  std::uint64_t oldest_seq = 0;
  std::uint64_t durable_next_seq = 0;
  std::uint64_t durable_next_event_seq = 0;
  std::uint64_t latest_robot_time_us = 0;  // of the latest frame
  std::optional<protocol::Status> status;
  ClockEstimate clock;
  StopPath stop_path;

  std::vector<ChangedLimit> changed_limits;  // as the robot said last
  std::uint64_t invalid_values = 0;      // that its frames had since the station started: not finite, beyond all range
  std::uint64_t events_left_out = 0;     // that it sent since then and nobody recorded: too many in a short time
  std::int64_t lease_renewed_at_us = 0;  // UTC when it last accepted a renewal of a lease; 0: not since then
  ControlState control;
  std::optional<Reservation> reservation;  // that runs now
  std::optional<CommandId> pending_stop;   // an emergency stop that no robot has acknowledged yet
  std::int64_t retired_at_us = 0;          // UTC; 0: in use

  // The station's own latch: no motion command passes while it is set.
  bool latched() const { return pending_stop.has_value() || context.emergency_id != 0; }
  bool operator==(const RobotState&) const = default;
};

enum class CommandState : std::uint8_t {
  queued,        // accepted by the station, not written yet
  sent,          // its frame was written
  acknowledged,  // the robot accepted it; the last state of one that telemetry cannot show, or could not: `reason`
  verified,      // telemetry has shown what it was to bring about
  rejected,      // the robot refused it: `reason`
  expired,       // its time to live ended before it took effect
  failed,        // the link ended before it was sent, or telemetry went on without showing it: `reason`
  superseded,    // a newer command took its place before it was sent, or could be seen
  unknown,       // it was sent and no answer came; whether it has run may be known later
};
inline constexpr auto kLastCommandState = CommandState::unknown;
constexpr bool was_accepted(CommandState state) {  // by the robot
  return state == CommandState::acknowledged || state == CommandState::verified;
}
const char* text(CommandState value);

// One command from submission to its end. What is published is always a copy.
struct CommandRecord {
  CommandId id = 0;
  RobotId robot_id;
  BootId boot_id = 0;
  std::string kind;       // "set_mode", "set_setpoint", …
  std::string arguments;  // as JSON, e.g. {"setpoint_m":0.1}
  std::string actor;      // who asked, e.g. "token:local" or "session:3"
  CommandState state = CommandState::queued;
  std::string reason;                // text of RejectReason or CommandResult, or a station's own
  std::int64_t submitted_at_us = 0;  // UTC
  std::int64_t sent_at_us = 0;
  std::int64_t ended_at_us = 0;
  std::uint64_t effect_at_robot_us = 0;
  std::uint64_t emergency_id = 0;  // the latch after it, as the robot says

  // Steady time from the request's arrival at the station to each stage, so no clock that is set bends it; -1: not
  // reached. A stop's are its latency: the frame left, the robot has obeyed, duty 0 was seen.
  std::int64_t sent_after_us = -1;
  std::int64_t acknowledged_after_us = -1;
  std::int64_t verified_after_us = -1;
  std::string life_from;  // its time to live counts from: "arrival", "stamp" (of /live), "issued_at"; empty for a stop
  std::string peer;       // the address that it came from; empty: from the station itself

  // Of a renewal of a lease that is stored: the renewals that the robot accepted right after it, and that have no
  // record of their own. None: not known, since they go on, or the station ended before they did (`reason`).
  std::optional<std::uint64_t> further_renewals = 0;
  std::int64_t last_renewed_at_us = 0;  // UTC when the last of them was submitted; 0: there is none, or it is not known
};

}  // namespace server::station
