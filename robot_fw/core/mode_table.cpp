// The table of commands and modes.
#include "robot_fw/core/mode_table.hpp"

namespace robot_fw {
namespace {

struct Row {
  pb_size_t action;
  protocol::RejectReason in_manual, in_auto, in_emergency;
};

constexpr auto kRuns = rheonaut_REJECT_REASON_NONE;
constexpr auto kWrongMode = rheonaut_REJECT_REASON_WRONG_MODE;
constexpr auto kNotLatched = rheonaut_REJECT_REASON_OTHER_EMERGENCY;
constexpr auto kLatched = rheonaut_REJECT_REASON_LATCHED;

// SAFETY: in emergency runs only what cannot move the motor, and what ends the emergency.
// clang-format off
constexpr Row kTable[] = {
    // command                                   manual       auto          emergency
    {rheonaut_Command_set_mode_tag,              kRuns,       kRuns,        kLatched},
    {rheonaut_Command_set_setpoint_tag,          kWrongMode,  kRuns,        kLatched},
    {rheonaut_Command_set_duty_tag,              kRuns,       kWrongMode,   kLatched},
    {rheonaut_Command_set_duty_schedule_tag,     kRuns,       kWrongMode,   kLatched},
    {rheonaut_Command_renew_lease_tag,           kRuns,       kRuns,        kLatched},
    {rheonaut_Command_emergency_stop_tag,        kRuns,       kRuns,        kRuns},
    {rheonaut_Command_clear_emergency_tag,       kNotLatched, kNotLatched,  kRuns},
    {rheonaut_Command_inject_disturbance_tag,    kWrongMode,  kRuns,        kLatched},
    {rheonaut_Command_zero_position_tag,         kRuns,       kWrongMode,   kLatched},
    {rheonaut_Command_set_controller_tag,        kRuns,       kRuns,        kLatched},
    {rheonaut_Command_restore_controller_tag,    kRuns,       kRuns,        kLatched},
    {rheonaut_Command_set_parameter_tag,         kRuns,       kRuns,        kRuns},
    {rheonaut_Command_get_parameters_tag,        kRuns,       kRuns,        kRuns},
    {rheonaut_Command_ping_tag,                  kRuns,       kRuns,        kRuns},
    {rheonaut_Command_drop_timed_tag,            kRuns,       kRuns,        kRuns},
};
// clang-format on

}  // namespace

protocol::RejectReason refusal_in(protocol::Mode mode, pb_size_t action) {
  for (const Row& row : kTable) {
    if (row.action != action) continue;
    if (mode == rheonaut_MODE_MANUAL) return row.in_manual;
    return mode == rheonaut_MODE_AUTO ? row.in_auto : row.in_emergency;
  }
  return rheonaut_REJECT_REASON_UNSUPPORTED;
}

}  // namespace robot_fw
