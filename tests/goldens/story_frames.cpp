// Values that floats hold exactly, or that no arithmetic of a compiler changes.
#include "tests/goldens/story_frames.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

namespace server {
namespace {

using Limits = std::numeric_limits<float>;
constexpr std::array<float, 10> kExtremes{
    Limits::denorm_min(), -Limits::denorm_min(), Limits::min(),       Limits::max(), Limits::lowest(), -0.0F,
    Limits::quiet_NaN(),  Limits::infinity(),    -Limits::infinity(), 0.1F};

template <std::size_t size>
void copy_text(char (&into)[size], const char* text) {
  std::strncpy(into, text, size - 1);
}

protocol::RobotFrame frame_of(pb_size_t body) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = body;
  return frame;
}

rheonaut_Parameter parameter(const char* name, const char* unit, float value, float default_value) {
  rheonaut_Parameter made = rheonaut_Parameter_init_zero;
  copy_text(made.name, name);
  copy_text(made.unit, unit);
  made.value = value;
  made.minimum = Limits::lowest();
  made.maximum = Limits::max();
  made.default_value = default_value;
  return made;
}

}  // namespace

protocol::RobotFrame hello_of(const std::string& id, std::uint64_t boot_id) {
  protocol::RobotFrame frame = TestRobot::hello_frame();
  protocol::Hello& hello = frame.body.hello;
  copy_text(hello.robot_id, id.c_str());
  copy_text(hello.firmware_version, "1.4.0-rc1");
  hello.boot_id = boot_id;
  hello.reset_cause = rheonaut_RESET_CAUSE_BROWN_OUT;
  hello.parameters_checksum = 0xdeadbeef;
  hello.controller_id = 7;
  hello.controller_checksum = 0xffffffff;
  return frame;
}

protocol::RobotFrame samples_of(std::uint64_t first_seq, pb_size_t count) {
  protocol::RobotFrame frame = TestRobot::samples_frame(first_seq, count, kFirstSampleUs + first_seq * 10'000, 0);
  protocol::Telemetry& batch = frame.body.telemetry;
  for (pb_size_t i = 0; i < count; ++i) {
    const auto seq = static_cast<float>(first_seq + i);
    batch.position_m[i] = seq / 1024;
    batch.velocity_m_s[i] = -seq / 4096;
    batch.acceleration_m_s2[i] = seq * 3;
    batch.duty[i] = i % 2 == 0 ? 0.3F : -1;
    batch.impedance_mv[i] = 1234.5F + seq;
    batch.reference_m[i] = 1 / (seq + 3);
  }
  batch.controller_id = 7;
  batch.position_sd_m = 0.001F;
  return frame;
}

protocol::RobotFrame extreme_samples(std::uint64_t first_seq) {
  protocol::RobotFrame frame = samples_of(first_seq, kExtremes.size());
  protocol::Telemetry& batch = frame.body.telemetry;
  for (std::size_t i = 0; i < kExtremes.size(); ++i) {
    std::size_t shift = i;
    for (float* channel : {batch.position_m, batch.velocity_m_s, batch.acceleration_m_s2, batch.duty,
                           batch.impedance_mv, batch.reference_m}) {
      channel[i] = kExtremes[shift++ % kExtremes.size()];
    }
  }
  batch.has_setpoint_m = true;
  batch.setpoint_m = Limits::denorm_min();
  batch.disturbance_m = -0.0F;
  batch.position_sd_m = Limits::max();
  batch.controller_id = 0xffffffff;
  return frame;
}

protocol::RobotFrame event_of(std::uint64_t event_seq, protocol::EventKind kind, protocol::EventCause cause) {
  protocol::RobotFrame frame = frame_of(rheonaut_RobotFrame_event_tag);
  protocol::Event& event = frame.body.event;
  event.event_seq = event_seq;
  event.event_robot_time_us = kFirstSampleUs + event_seq;
  event.kind = kind;
  event.cause = cause;
  event.sample_seq = event_seq;
  event.mode = rheonaut_MODE_MANUAL;
  event.position_m = 0.1F;
  event.value = -0.25F;
  return frame;
}

protocol::RobotFrame parameters() {
  protocol::RobotFrame frame = frame_of(rheonaut_RobotFrame_parameter_page_tag);
  protocol::ParameterPage& page = frame.body.parameter_page;
  page.total = page.parameters_count = 2;
  page.parameters[0] = parameter("position_max_m", "m", 0.1F, 0.30000001F);
  page.parameters[1] = parameter("duty_slew_per_s", "1/s", Limits::denorm_min(), Limits::denorm_min());
  return frame;
}

protocol::RobotFrame controller() {
  protocol::RobotFrame frame = frame_of(rheonaut_RobotFrame_controller_tag);
  protocol::Controller& made = frame.body.controller;
  made.controller_id = 7;
  made.checksum = 0xffffffff;
  made.period_us = 10'000;
  made.kp = 65.0028F;
  made.direct = -1e-7F;
  made.pole_count = made.residue_count = 2;
  made.pole[0] = 0.99999994F;
  made.residue[1] = -0.25F;
  made.biquad_b0_count = made.biquad_b1_count = made.biquad_a1_count = made.biquad_a2_count = 1;
  made.biquad_b0[0] = 0.125F;
  made.biquad_a2[0] = -1e30F;
  made.duty_min = -0.5F;
  made.duty_max = 1;
  made.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT;
  return frame;
}

protocol::RobotFrame status() {
  protocol::RobotFrame frame = frame_of(rheonaut_RobotFrame_status_tag);
  frame.body.status = {.supply_mv = 3712.5F,
                       .rssi_dbm = -71,
                       .free_memory_bytes = 4'294'967'295,
                       .worst_tick_us = 9'999,
                       .missed_ticks = 1,
                       .ring_fill = 800,
                       .imu_calibration = 3,
                       .bad_frames = 2,
                       .lost_samples = 3,
                       .lost_events = 4};
  return frame;
}

}  // namespace server
