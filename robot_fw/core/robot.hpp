// The whole robot: a tick, bytes in, bytes out.
//
//   step()      one tick, 100 Hz: estimator, sensors, link, orders, limits, impedance, reference, controller, slew,
//   safety,
//               telemetry
//   receive()   bytes from the station, at any time between ticks; an emergency stop acts in here
//   transmit()  bytes to the station, at any time between ticks; never waits
// The board (a simulated robot, an ESP8266) owns the clock, the connection and the motor pin. After every call it
// applies duty() to the motor.
#pragma once

#include "robot_fw/core/commands.hpp"
#include "robot_fw/core/hardware_io.hpp"
#include "robot_fw/core/impedance_monitor.hpp"
#include "robot_fw/core/motion_sense.hpp"
#include "robot_fw/core/pilot.hpp"
#include "robot_fw/core/reference_profile.hpp"
#include "robot_fw/core/robot_settings.hpp"
#include "robot_fw/core/safety.hpp"
#include "robot_fw/core/sensor_watch.hpp"
#include "robot_fw/core/station_channel.hpp"

namespace robot_fw {

struct RobotConfig {
  const char* robot_id = "";          // 1 to 31 characters of [a-z0-9_-]; must outlive the robot, as all text here
  const char* token = "";             // at most 71 characters
  const char* firmware_version = "";  // at most 23 characters
  std::uint64_t boot_id = 0;          // random, new in each boot, never 0
  protocol::ResetCause reset_cause = rheonaut_RESET_CAUSE_POWER_ON;
  float duty_min = -1;                  // in [-1, 0]
  float duty_max = 1;                   // in (0, 1]
  std::uint32_t samples_per_frame = 5;  // 1 to 25; the station may ask for another
  std::uint32_t sample_period_us = 10'000;
  std::uint64_t restored_emergency_id = 0;  // a latch that the board's memory kept over the reset; 0: none
  protocol::EmergencyCause restored_emergency_cause = rheonaut_EMERGENCY_CAUSE_NONE;
  Storage* storage = nullptr;  // of parameters and controller, outlives the robot; null: they end with the boot
};

class Robot {
 public:
  explicit Robot(const RobotConfig& config);

  Outputs step(const Inputs& inputs, float dt_s);

  void link_opened(std::uint64_t now_us);
  void link_closed(std::uint64_t now_us);
  // False when the connection must be closed: it speaks something else, or the station refused it.
  bool receive(protocol::Bytes bytes, std::uint64_t now_us);
  // Writes the message due first to `out`, one whole frame; 0 when none is due or it does not fit.
  std::size_t transmit(std::uint8_t* out, std::size_t capacity, std::uint64_t now_us);
  // The station has been silent on an open connection for the time-out: close it and dial again.
  bool connection_is_silent(std::uint64_t now_us) const { return channel_.link().connection_is_silent(now_us); }

  // What the storage was given could not be kept after all.
  void storage_failed();

  float duty() const { return duty_; }
  protocol::Mode mode() const;
  std::uint64_t emergency_id() const { return safety_.emergency_id(); }
  protocol::EmergencyCause emergency_cause() const { return safety_.cause(); }
  // Nothing moves or is ordered to: what blocks for long may be done now.
  bool at_rest() const { return !motor_on(); }
  bool link_up() const { return channel_.link().up(); }
  bool link_lost() const { return channel_.link().lost(); }
  // Why the station refused the last connection; the detail is for people.
  protocol::RefusalReason refusal() const { return channel_.refusal(); }
  const char* refusal_detail() const { return channel_.refusal_detail(); }
  // For who counts what became of the samples; commands include those that were refused.
  const TelemetryRing& samples() const { return channel_.samples(); }
  const Outbox& outbox() const { return channel_.outbox(); }
  std::uint32_t commands_received() const { return channel_.commands_received(); }
  // CRC-32 over every float that a tick works with: equal on two machines that compute alike.
  std::uint32_t float_state_checksum() const;

 private:
  // The parts of a tick, in robot.cpp.
  bool sound(const Inputs& inputs, float dt_s) const;
  void load_settings();
  void save_settings();
  bool motor_on() const { return duty_ != 0 || pilot_.motion_ordered(); }
  float watch_clock(std::uint64_t robot_time_us, float dt_s);
  void run_due_commands();
  void let_orders_run_out();
  ControllerDuty wanted_duty(const Motion& measured, float dt_s);
  float slewed(float duty, float dt_s) const;
  void record_sample(const Motion& measured, float dt_s);
  BatchValues batch_values() const;
  Motion seen_motion() const;  // by the controller: disturbance included
  void stop_motion(protocol::EventCause cause, std::uint64_t command_id = 0);
  void emergency(protocol::EmergencyCause cause, protocol::EventCause event_cause, std::uint64_t command_id);
  void announce_controller();
  void note_controller(protocol::EventCause cause, std::uint64_t command_id = 0);
  void note(protocol::EventKind kind, protocol::EventCause cause, float value, std::uint64_t command_id = 0);

  // What ends or changes motion by itself, in robot_watch.cpp.
  void watch_sensors();
  void on_sensor_news(SensorFault fault, protocol::EventCause which, float reading);
  SensorFault electrode_fault() const;
  bool sensor_fault_stands() const;
  void watch_supply();
  void watch_link();
  void watch_limits(const Motion& measured, float dt_s);
  void watch_certainty(float wanted_duty);
  void watch_impedance(const Motion& measured);
  void end_delivery(protocol::EventCause cause, std::uint64_t command_id);
  void watch_arrival(const Motion& measured);

  // Commands, in robot_commands.cpp.
  void on_command(const protocol::Command& command);
  void on_emergency_stop(const protocol::Command& command);
  protocol::CommandAck ack_for(std::uint64_t command_id, Verdict verdict, std::uint64_t effect_at_us) const;
  void answer(std::uint64_t command_id, Verdict verdict);
  void run_timed_command(const protocol::Command& command);
  void drop_timed_commands(Verdict verdict);
  Verdict execute(const protocol::Command& command);
  Verdict set_mode(const rheonaut_SetMode& order, std::uint64_t command_id);
  Verdict set_setpoint(float setpoint_m, std::uint64_t command_id);
  Verdict set_duty(const rheonaut_SetDuty& order);
  Verdict renew_lease(const rheonaut_RenewLease& order);
  Verdict set_duty_schedule(const rheonaut_SetDutySchedule& order);
  Verdict clear_emergency(std::uint64_t emergency_id, std::uint64_t command_id);
  Verdict inject_disturbance(float disturbance_m, std::uint64_t command_id);
  Verdict zero_position(std::uint64_t command_id);
  Verdict check_position(float position_m) const;
  Verdict check_setpoint(float setpoint_m) const;
  Verdict check_certainty(float setpoint_m) const;
  Verdict announced(Verdict about_the_controller);
  Verdict set_parameter(const rheonaut_SetParameter& order, std::uint64_t command_id);
  Verdict get_parameters(std::uint32_t first_index, std::uint64_t command_id);
  PositionLimits position_limits() const;

  // Frames in and out, in robot_frames.cpp.
  bool on_frame();
  bool on_welcome(const protocol::Welcome& welcome);
  void on_station_frame();
  void fill(Outgoing what, protocol::RobotFrame& frame) const;
  void fill_parameters(const PageRequest& request, protocol::ParameterPage& page) const;
  void fill_hello(protocol::Hello& hello) const;
  void fill_status(protocol::Status& status) const;

  RobotConfig config_;
  std::uint64_t now_us_ = 0;
  Inputs inputs_{};  // of the last tick
  bool inputs_are_sound_ = true;
  float reference_m_ = 0;  // in auto
  float duty_ = 0;
  bool saturated_ = false;
  std::uint64_t time_step_reported_us_ = 0;
  float unreported_step_s_ = 0;
  std::uint32_t worst_tick_us_ = 0;  // since the last status

  // Small parts first: what is near costs the chip less code.
  Pilot pilot_;
  Safety safety_;
  ReferenceProfile profile_;
  ImpedanceMonitor impedance_;
  SensorWatch electrode_;
  SensorFault reported_electrode_fault_ = SensorFault::none;
  RobotSettings settings_;
  MotionSense motion_sense_;
  TimedCommands timed_;
  CommandFilter filter_;
  StationChannel channel_;
};

// What the ESP8266 has for all of it besides the ring and the bytes of a frame. A host's pointers and sizes take more;
// its limit is there to notice growth in every build.
static_assert(sizeof(Robot) - sizeof(TelemetryRing) - sizeof(protocol::FrameReader) <=
                  (sizeof(void*) == 4 ? 4352 : 4480),
              "the robot outgrew its memory");

}  // namespace robot_fw
