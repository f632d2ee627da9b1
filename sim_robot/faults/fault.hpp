// The faults of a simulated robot while it runs: begun by a time line, over HTTP, or by a test.
//
// One struct for all kinds; fields() says which of its members a kind has, with names, units, ranges and defaults.
// TOML, JSON and docs/scenarios.md follow from it. A fault on a target replaces the one that is in force there. Errors:
// throws std::invalid_argument that says what is wrong, which value it has, and what is allowed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "base/fields.hpp"
#include "protocol/messages.hpp"
#include "sim_robot/faults/faulty_robot.hpp"
#include "sim_robot/world/glucose.hpp"
#include "sim_robot/world/pump.hpp"
#include "sim_robot/world/sensor_fault.hpp"

namespace sim_robot {

using base::Fields;
using base::kForEver;
using base::kMustBeGiven;
using base::Range;

struct WorldConfig;

// In the order of fault_types().
enum class FaultKind {
  accelerometer_stuck,
  accelerometer_noisy,
  accelerometer_offset,
  accelerometer_missing,
  electrode_stuck,
  electrode_noisy,
  electrode_offset,
  electrode_missing,
  mean_flow,
  pump_flow,
  pour_glucose,
  link_outage,
  link_half_open,
  link_cut,
  link_reset,
  link_delay,
  link_throttle,
  link_loss,
  link_split,
  reboot,
  block,
  clock_drift,
  clock_jump,
  motor_supply_cut,
};

// As a profile of an experiment names it: docs/experiments.md, conditions.pump.
enum class PumpSetting : std::uint8_t { off, constant, pulse_70_bpm };

enum class FaultTarget {
  accelerometer,
  electrode,
  pump,
  glucose,
  link,
  delay,
  rate,
  loss,
  split,
  robot,
  clock,
  motor_supply
};

struct FaultType {
  const char* name;  // as in FaultKind
  FaultTarget target;
  bool lasts;  // has for_s and is in force for so long; otherwise it happens at once and is over
  const char* what;
};

std::span<const FaultType> fault_types();
const FaultType& type_of(FaultKind kind);

struct Fault {
  FaultKind kind = FaultKind::accelerometer_stuck;
  double for_s = kForEver;  // of those that last; for ever: until it is withdrawn

  double magnitude = kMustBeGiven;  // sensors: m/s² or mV; sd of the noise, or the offset
  double mean_flow_m3_s = kMustBeGiven;
  PumpSetting pump = PumpSetting::off;
  double mean_flow_m_s = 0;                        // in the tube that the robot is in when it begins
  GlucosePatch patch{.position_m = kMustBeGiven};  // poured at once; its for_s says when it is removed

  Direction direction = Direction::both;
  bool then_reset = false;        // an outage ends with the end of the connections
  std::uint64_t after_bytes = 0;  // a cut: how many of those under way still arrive
  double delay_s = kMustBeGiven, jitter_s = 0;
  double bytes_per_s = kMustBeGiven;
  double loss_probability = kMustBeGiven, retransmit_s = 0.2;
  std::uint64_t split_bytes = 1;

  protocol::ResetCause cause = rheonaut_RESET_CAUSE_SOFTWARE;
  double off_for_s = 0.5;
  bool keeps_latch = true, keeps_storage = true;
  double drift_ppm = kMustBeGiven;
  double jump_s = kMustBeGiven;
};

// The members that its kind has, without the kind itself.
void fields(Fields& fields, Fault& fault);
// Kind and members: the key `fault` first.
void fields_with_kind(Fields& fields, Fault& fault);

// Throws what is wrong with its values, or what the world lacks for it.
void check(const Fault& fault, const WorldConfig& world);

// Empty when a run with (or without) its own network can have this fault; otherwise why not.
std::string why_not(FaultKind kind, bool has_network);
// The same for this robot; throws what why_not() says, too.
void check(const Fault& fault, const FaultyRobot& robot);
// Begins the fault with the robot's next tick. Throws as check() does.
void apply(const Fault& fault, const FaultyRobot& robot);
// Ends a lasting fault: its target is again as it was when robot and link were made.
void end(const Fault& fault, const FaultyRobot& robot);
// Whether robot or link end it by themselves after its for_s.
bool ends_by_itself(FaultKind kind);

// {"fault":"electrode_offset","offset_mv":40,"for_s":5}
Fault parse_fault_json(std::string_view json);

}  // namespace sim_robot
