// A core whose sensors the test sets by hand, connected to a station that receives everything.
//
// It is a value: a copy goes its own way, which shows what a command or an event changes and what it leaves.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "robot_fw/core/robot.hpp"

namespace robot_fw {

class BareCore {
 public:
  static constexpr std::uint64_t kBootId = 0xB007;
  static constexpr std::uint64_t kTickUs = 10'000;
  static constexpr std::uint32_t kLinkTimeoutMs = 100;

  static RobotConfig config() {
    RobotConfig config;
    config.boot_id = kBootId;
    return config;
  }
  explicit BareCore(const RobotConfig& config = BareCore::config())
      : range{config.duty_min, config.duty_max}, robot(config) {
    connect();
  }

  // One tick, then the station listens and gives a sign of life.
  void tick() {
    now_us += kTickUs;
    step(inputs());
    if (!attentive) return;
    if (renews) order(command_of(rheonaut_Command_renew_lease_tag));
    heartbeat();
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  // Whatever happens in a tick, this holds.
  void step(const Inputs& inputs) {
    const std::uint64_t latch = robot.emergency_id();
    robot.step(inputs, 0.01F);
    listen();
    if (latch != 0 && latch != asked_to_clear_)
      EXPECT_EQ(robot.emergency_id(), latch) << "a tick cleared or renewed the latch";
    EXPECT_EQ(sample.duty[0], robot.duty());
    expect_sound();
    EXPECT_EQ(sample.has_setpoint_m, robot.mode() == rheonaut_MODE_AUTO);
    if (robot.mode() != rheonaut_MODE_AUTO) EXPECT_EQ(sample.disturbance_m, 0);
  }
  // What the sensors say now.
  Inputs inputs() {
    Inputs inputs;
    inputs.robot_time_us = now_us;
    forth_ = !forth_;
    const int swing = mean_counts + (forth_ ? swing_counts : -swing_counts);
    inputs.acceleration_counts = steady_counts.value_or(static_cast<std::int16_t>(swing));
    inputs.acceleration_is_valid = accelerometer_answers;
    if (known_position_m) inputs.known_motion = Motion{*known_position_m, 0, 0};
    inputs.impedance_mv = impedance_mv;
    inputs.supply_mv = supply_mv;
    inputs.motor_supply_is_cut = motor_supply_is_cut;
    return inputs;
  }

  static protocol::Command command_of(pb_size_t action) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = action;
    return command;
  }
  // Sends a command and receives the answer; adds id, boot and time to live where they are 0.
  protocol::CommandAck order(protocol::Command command) {
    if (command.command_id == 0) command.command_id = ++last_id_;
    if (command.boot_id == 0) command.boot_id = kBootId;
    if (command.valid_until_robot_us == 0) command.valid_until_robot_us = now_us + 1'000'000;
    acks.clear();
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    frame.body.command = command;
    const std::uint64_t latch = robot.emergency_id();
    send(frame);
    listen();
    const bool stops = command.which_action == rheonaut_Command_emergency_stop_tag;
    if (command.which_action == rheonaut_Command_clear_emergency_tag) {
      asked_to_clear_ = command.action.clear_emergency.emergency_id;  // perhaps for later
    }
    if (latch != 0 && latch != asked_to_clear_ && !stops)
      EXPECT_EQ(robot.emergency_id(), latch) << "only a clear that names the latch ends it";
    if (stops) EXPECT_EQ(robot.mode(), rheonaut_MODE_EMERGENCY);
    expect_sound();
    // A mode that ends answers for the commands that waited in it, too.
    const auto own = [&](const protocol::CommandAck& ack) { return ack.command_id == command.command_id; };
    const auto answer = std::find_if(acks.rbegin(), acks.rend(), own);
    return answer == acks.rend() ? protocol::CommandAck{} : *answer;
  }
  void heartbeat() {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_heartbeat_tag;
    frame.body.heartbeat.durable_next_seq = sample.first_seq + 1;
    frame.body.heartbeat.durable_next_event_seq = next_event_seq_;
    send(frame);
  }
  // A new connection; what it says of itself is in `hello`.
  void connect() {
    robot.link_opened(now_us);
    listen();
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    frame.body.welcome.link_timeout_ms = kLinkTimeoutMs;
    frame.body.welcome.samples_per_frame = 1;
    send(frame);
    listen();
  }
  // What it would say of itself on a new connection.
  protocol::Hello hello_now() const {
    BareCore copy = *this;
    copy.connect();
    return copy.hello;
  }

  DutyRange range;
  Robot robot;
  std::uint64_t now_us = 0;
  bool attentive = true;  // gives signs of life
  bool renews = true;     // keeps the lease of what runs

  // The sensors: by default an accelerometer at rest, and no glucose.
  int mean_counts = 0, swing_counts = 1;      // forth and back
  std::optional<std::int16_t> steady_counts;  // in place of that
  bool accelerometer_answers = true;
  std::optional<float> known_position_m;  // of a perfect sensor
  float impedance_mv = 175;
  float supply_mv = 3000;
  bool motor_supply_is_cut = false;

  protocol::Hello hello = rheonaut_Hello_init_zero;
  protocol::Telemetry sample = rheonaut_Telemetry_init_zero;  // the last one
  std::vector<protocol::Event> events;                        // since the test has emptied it
  std::vector<protocol::CommandAck> acks;                     // to the last command

 private:
  void expect_sound() const {
    EXPECT_TRUE(range.contains(robot.duty())) << robot.duty();
    if (robot.mode() == rheonaut_MODE_EMERGENCY) EXPECT_EQ(robot.duty(), 0);
  }
  void send(const protocol::StationFrame& frame) {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
    const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
    EXPECT_TRUE(robot.receive({bytes.data(), size}, now_us));
  }
  void listen() {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
    protocol::FrameReader reader;
    while (const std::size_t size = robot.transmit(buffer.data(), buffer.size(), now_us)) {
      protocol::Bytes bytes{buffer.data(), size};
      ASSERT_EQ(reader.push(bytes), protocol::FrameReader::State::complete);
      const auto frame = protocol::decode_robot_frame(reader.payload());
      ASSERT_TRUE(frame.has_value());
      switch (frame->which_body) {
        case rheonaut_RobotFrame_hello_tag: hello = frame->body.hello; break;
        case rheonaut_RobotFrame_command_ack_tag: acks.push_back(frame->body.command_ack); break;
        case rheonaut_RobotFrame_event_tag:
          events.push_back(frame->body.event);
          next_event_seq_ = frame->body.event.event_seq + 1;
          break;
        case rheonaut_RobotFrame_telemetry_tag: sample = frame->body.telemetry; break;
        default: break;
      }
    }
  }

  bool forth_ = false;
  std::uint64_t last_id_ = 1000;
  std::uint64_t next_event_seq_ = 0;
  std::uint64_t asked_to_clear_ = 0;  // the latch named last
};

}  // namespace robot_fw
