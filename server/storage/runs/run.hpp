// A run as a value: a named span of a robot's recording, with the conditions of the experiment.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/station/state/station_state.hpp"

namespace server::storage {

inline constexpr std::size_t kMaxRunTextBytes = 10'000;  // of each text but its name

using RunId = std::int64_t;

enum class RunState : std::uint8_t {
  open,
  ended,
  interrupted,  // the station stopped while it was open
  discarded,    // its samples are no longer held
};
const char* text(RunState value);
std::optional<RunState> run_state_from(const std::string& text);

// What the experimenter says of a run; all optional but the name.
struct RunConditions {
  std::string name;
  std::string fluid;  // as Envelope lists it, or as it was written before there was a list; empty: not known
  std::string pump_profile;
  std::optional<double> mean_flow_m_s;
  std::string tube;
  std::string operator_name;
  std::string profile;  // of the experiment, e.g. "step to 0.1 m"; pump_profile is the pump's
  std::string notes;
  std::string verdict;
};

// What is to be said otherwise of a run: the conditions that are given, by their names in RunConditions.
struct RunAnnotation {
  std::map<std::string, std::string> texts;
  bool has_mean_flow = false;
  std::optional<double> mean_flow_m_s;
  bool names_fluid_of_robot = true;  // the fluid of an open run is its robot's, too
};

// Samples of a robot that were recorded already.
struct TimeSpan {  // UTC, both ends included; over reboots
  std::int64_t from_us = 0;
  std::int64_t to_us = 0;
};
struct SeqSpan {  // both ends included
  station::BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
};
using RecordedRange = std::variant<TimeSpan, SeqSpan>;

struct RunSpan {
  station::BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::optional<std::uint64_t> last_seq;  // inclusive; empty while the span is open
};

// Ticks of the robot's loop at which it made no sample. None is lost by that, and seq goes on without a gap.
struct MissedTicks {
  std::uint64_t count = 0;
  std::uint64_t longest = 0;  // in a row
  bool operator==(const MissedTicks&) const = default;
};

// A part of a run in which the experiment that made it was paused or interrupted: the robot came to rest and waited. It
// is recorded like the rest; a fit simulates through it.
struct InterruptedPart {
  std::uint32_t span = 0;
  std::uint64_t from_robot_us = 0;  // the first tick at which the line did not go on
  std::uint64_t to_robot_us = 0;    // from here on it did
  std::string reason;               // for programs, e.g. "link_lost"
  std::string detail;
};

// The experiment that made a run.
struct RunOrigin {
  std::int64_t experiment = 0;
  std::uint32_t number = 0;    // of the run in it, from 1
  std::string profile_sha256;  // of the profile's document as it was performed
};

// The same with what was performed.
struct PerformedProfile {
  RunOrigin origin;
  std::string variant;   // JSON: fluid, controller, factors, repeat, step
  std::string document;  // TOML or JSON
};

struct Run {
  RunId id = 0;
  station::RobotId robot_id;
  RunState state = RunState::open;
  bool made_afterwards = false;  // from what had been recorded already
  std::string made_by;           // the actor, e.g. "token:local"; empty: not known
  RunConditions conditions;
  std::string firmware_version;
  std::uint32_t controller_id = 0;
  std::uint32_t controller_checksum = 0;
  std::uint32_t parameters_checksum = 0;
  std::int64_t started_at_us = 0;  // UTC
  std::optional<std::int64_t> ended_at_us;
  std::vector<RunSpan> spans;
  std::uint64_t samples_expected = 0;  // so far, in all spans
  std::uint64_t samples_stored = 0;
  std::uint64_t samples_lost = 0;            // known to be lost for good; expected - stored - lost is still on its way
  std::optional<MissedTicks> missed;         // counted with the digest, when the run has ended; none: not yet
  std::vector<InterruptedPart> interrupted;  // in order of time
  std::optional<RunOrigin> origin;           // none: it is of no experiment
};

// What a run was made with, as far as it is known.
struct InForce {
  std::uint32_t span = 0;
  std::string kind;             // controller, parameters, station
  std::uint64_t first_seq = 0;  // of the span: in force from here on
  std::string content;          // JSON
};
struct RunSnapshot {
  std::string firmware_version;
  std::uint32_t controller_id = 0;
  std::uint32_t controller_checksum = 0;
  std::uint32_t parameters_checksum = 0;
  std::vector<InForce> in_force;  // in order of span, kind and first_seq
};

// Which runs, newest first.
struct RunFilter {
  std::optional<station::RobotId> robot_id;
  std::optional<RunState> state;  // empty: all but the discarded
  RunId before = 0;               // 0: from the newest
  std::size_t limit = 100;        // 1 to 1000
};

}  // namespace server::storage
