// The table of faults: names, what each has, units, ranges and defaults.
#include <array>

#include "sim_robot/faults/fault.hpp"
#include "sim_robot/scenario/world_fields.hpp"

namespace sim_robot {
namespace {

using enum FaultTarget;

constexpr std::array kTypes{
    FaultType{"accelerometer_stuck", accelerometer, true, "the accelerometer gives the same count for ever"},
    FaultType{"accelerometer_noisy", accelerometer, true, "white noise on top of its readings"},
    FaultType{"accelerometer_offset", accelerometer, true, "a constant on top of its readings"},
    FaultType{"accelerometer_missing", accelerometer, true, "it gives no reading"},
    FaultType{"electrode_stuck", electrode, true, "the electrode gives the same reading for ever"},
    FaultType{"electrode_noisy", electrode, true, "white noise on top of its readings"},
    FaultType{"electrode_offset", electrode, true, "a constant on top of its readings"},
    FaultType{"electrode_missing", electrode, true, "it reads 0 mV"},
    FaultType{"mean_flow", pump, true, "another mean flow of the pump, over its ramp; then that of the beginning"},
    FaultType{"pump_flow", pump, true, "the pump as an experiment names it, over its ramp; then as in the beginning"},
    FaultType{"pour_glucose", glucose, false, "one more patch of glucose"},
    FaultType{"link_outage", link, true, "nothing passes between robot and station"},
    FaultType{"link_half_open", link, true, "the connection stays and says nothing"},
    FaultType{"link_cut", link, false, "the connection ends within what is under way"},
    FaultType{"link_reset", link, false, "the connection ends at once, and what was under way is gone"},
    FaultType{"link_delay", delay, true, "bytes arrive later"},
    FaultType{"link_throttle", rate, true, "few bytes a second"},
    FaultType{"link_loss", loss, true, "segments are lost and sent again after a time-out"},
    FaultType{"link_split", split, true, "bytes come out in small pieces"},
    FaultType{"reboot", robot, false, "the robot boots again"},
    FaultType{"block", robot, true, "its loop does nothing else for so long: ticks are missed"},
    FaultType{"clock_drift", clock, true, "its clock goes too fast or too slow"},
    FaultType{"clock_jump", clock, false, "its clock alone jumps"},
    FaultType{"motor_supply_cut", motor_supply, true, "a switch cuts the motor's supply; the robot senses it"},
};
static_assert(kTypes.size() == static_cast<std::size_t>(FaultKind::motor_supply_cut) + 1);

constexpr std::array<const char*, 3> kDirections{"up", "down", "both"};
constexpr std::array<const char*, 6> kCauses{"unknown", "power_on", "software", "watchdog", "brown_out", "external"};
constexpr Range kDuration{0.001, kForEver};
constexpr double kMostAcceleration_m_s2 = 160, kMostImpedanceMv = 5000;

constexpr std::array<const char*, 3> kPumpSettings{"off", "constant", "pulse_70_bpm"};

void pump_flow_fields(Fields& fields, Fault& fault) {
  auto index = static_cast<std::size_t>(fault.pump);
  fields.choice("pump", index, kPumpSettings, "constant: without pulsation");
  fault.pump = static_cast<PumpSetting>(index);
  fields.number("mean_flow_m_s", fault.mean_flow_m_s, {-1, 1},
                "mean velocity in the tube that the robot is in; 0 if the pump is off");
}

void direction_field(Fields& fields, Fault& fault) {
  auto index = static_cast<std::size_t>(fault.direction);
  fields.choice("direction", index, kDirections, "up: robot to station; down: station to robot");
  fault.direction = static_cast<Direction>(index);
}

void magnitude_field(Fields& fields, Fault& fault) {
  switch (fault.kind) {
    case FaultKind::accelerometer_noisy:
      return fields.number("sd_m_s2", fault.magnitude, {0, kMostAcceleration_m_s2}, "standard deviation");
    case FaultKind::accelerometer_offset:
      return fields.number("offset_m_s2", fault.magnitude, {-kMostAcceleration_m_s2, kMostAcceleration_m_s2},
                           "what is added");
    case FaultKind::electrode_noisy:
      return fields.number("sd_mv", fault.magnitude, {0, kMostImpedanceMv}, "standard deviation");
    case FaultKind::electrode_offset:
      return fields.number("offset_mv", fault.magnitude, {-kMostImpedanceMv, kMostImpedanceMv}, "what is added");
    default: return;
  }
}

void link_fields(Fields& fields, Fault& fault) {
  switch (fault.kind) {
    case FaultKind::link_outage:
      return fields.flag("then_reset", fault.then_reset, "at its end the connections are reset");
    case FaultKind::link_cut:
      return fields.whole("after_bytes", fault.after_bytes, {0, 1e6}, "so many of those under way still arrive");
    case FaultKind::link_delay:
      fields.number("delay_s", fault.delay_s, {0, 60}, "so much later");
      fields.number("jitter_s", fault.jitter_s, {0, 60}, "and at most so much more, at random");
      return direction_field(fields, fault);
    case FaultKind::link_throttle:
      fields.number("bytes_per_s", fault.bytes_per_s, {1, 1e9}, "at most so many");
      return direction_field(fields, fault);
    case FaultKind::link_loss:
      fields.number("loss_probability", fault.loss_probability, {0, 0.95}, "of a segment, each time it is sent");
      fields.number("retransmit_s", fault.retransmit_s, {0.01, 60}, "the time-out, doubled with each loss in a row");
      return direction_field(fields, fault);
    case FaultKind::link_split:
      fields.whole("split_bytes", fault.split_bytes, {1, 65536}, "at most so many come out at once");
      return direction_field(fields, fault);
    case FaultKind::link_half_open: return direction_field(fields, fault);
    default: return;
  }
}

void robot_fields(Fields& fields, Fault& fault) {
  if (fault.kind == FaultKind::reboot) {
    auto index = static_cast<std::size_t>(fault.cause);
    fields.choice("cause", index, kCauses, "what it says of its boot");
    fault.cause = static_cast<protocol::ResetCause>(index);
    fields.number("off_for_s", fault.off_for_s, {0, 3600}, "reset, boot and Wi-Fi");
    fields.flag("keeps_latch", fault.keeps_latch, "an emergency outlives it");
    fields.flag("keeps_storage", fault.keeps_storage, "parameters and controller outlive it");
  }
  if (fault.kind == FaultKind::clock_drift) {
    fields.number("drift_ppm", fault.drift_ppm, {-100'000, 100'000}, "fast is positive");
  }
  if (fault.kind == FaultKind::clock_jump) fields.number("jump_s", fault.jump_s, {-1e6, 1e6}, "forwards is positive");
}

}  // namespace

std::span<const FaultType> fault_types() { return kTypes; }
const FaultType& type_of(FaultKind kind) { return kTypes.at(static_cast<std::size_t>(kind)); }

void fields(Fields& fields, Fault& fault) {
  if (fault.kind == FaultKind::mean_flow) {
    fields.number("mean_flow_m3_s", fault.mean_flow_m3_s, kFlowRange, "negative: backwards");
  }
  if (fault.kind == FaultKind::pump_flow) pump_flow_fields(fields, fault);
  if (fault.kind == FaultKind::pour_glucose) patch_fields(fields, fault.patch);
  magnitude_field(fields, fault);
  link_fields(fields, fault);
  robot_fields(fields, fault);
  const bool is_removed = fault.kind == FaultKind::pour_glucose;
  if (type_of(fault.kind).lasts || is_removed) {
    fields.number("for_s", fault.for_s, kDuration, is_removed ? "then it is removed" : "then it is over");
  }
}

void fields_with_kind(Fields& fields, Fault& fault) {
  static const auto kNames = [] {
    std::array<const char*, kTypes.size()> names{};
    for (std::size_t i = 0; i < names.size(); ++i) names[i] = kTypes[i].name;
    return names;
  }();
  std::size_t index = kNames.size();
  fields.choice("fault", index, kNames, "what goes wrong");
  fault.kind = static_cast<FaultKind>(index < kNames.size() ? index : 0);
  sim_robot::fields(fields, fault);
}

}  // namespace sim_robot
