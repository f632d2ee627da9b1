// The robot on a chip of variables, and a station at the other end of its socket.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "chip.hpp"
#include "protocol/frame.hpp"
#include "robot_fw/esp8266/board.hpp"
#include "sim_robot/lab/station_commands.hpp"

namespace robot_fw::esp8266 {

constexpr char kStationKey[] = "-----BEGIN PUBLIC KEY-----\nthe station's";
inline const Secrets kTestSecrets{"robot-1", "token", "wifi", "password", "192.0.2.1", 7070, kStationKey};
constexpr int kMotorPin = kSettings.motor.pwm_pin;
constexpr std::uint32_t kTurnUs = 250;  // of the loop

class BoardFixture : public ::testing::Test {
 protected:
  BoardFixture() { new_chip(); }

  void new_chip() {
    chip = Chip{};
    chip.imu_registers[0x00] = 0xA0;
    chip.analogue = 180;  // counts; the electrode in clear fluid
  }

  void boot(const Settings& settings = kSettings) {
    board.reset();
    board.emplace(kTestSecrets, settings);
    board->begin();
    read_writes = 0;
  }

  void run_ms(std::uint32_t ms) {
    for (std::uint32_t i = 0; i < ms * 1000 / kTurnUs; ++i) {
      chip.pass(kTurnUs);
      auto& low_byte = chip.imu_registers[0x28];  // at rest: a reading that never changes is a fault
      if (low_byte <= 1 && chip.now_us % 10'000 < kTurnUs) low_byte ^= 1;
      board->step();
    }
  }

  // Boots, joins, dials and is welcomed.
  void connect(const Settings& settings = kSettings) {
    boot(settings);
    come_up();
  }
  void come_up() {
    for (int i = 0; i < 200 && board->link().state() != StationLink::State::open; ++i) run_ms(100);
    ASSERT_EQ(board->link().state(), StationLink::State::open);
    run_ms(1);
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    say(frame);
    run_ms(20);
    ASSERT_TRUE(board->robot().link_up());
  }

  void say(const protocol::StationFrame& frame) {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
    const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
    chip.socket.incoming.insert(chip.socket.incoming.end(), bytes.begin(), bytes.begin() + size);
  }
  void order(protocol::Command command) {
    command.command_id = ++last_command_id;
    command.boot_id = boot_id();
    command.valid_until_robot_us = chip.now_us + 1'000'000;
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    frame.body.command = command;
    say(frame);
  }
  // Every 100 ms, as a station that is alive.
  void heartbeat() {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_heartbeat_tag;
    say(frame);
  }
  // Long enough for the accelerometer, which starts slowly, to be believed.
  void wait_for_sensors() {
    for (int i = 0; i < 15; ++i) {
      heartbeat();
      run_ms(100);
    }
  }
  // A duty under a lease of 0.5 s, and the ticks it takes to act.
  void drive(float duty) {
    order(sim_robot::set_duty(duty, 500));
    run_ms(20);
    ASSERT_EQ(board->robot().duty(), duty);
  }

  // Of the Hello of this connection.
  std::uint64_t boot_id() {
    for (const protocol::RobotFrame& frame : received()) {
      if (frame.which_body == rheonaut_RobotFrame_hello_tag) known_boot_id = frame.body.hello.boot_id;
    }
    return known_boot_id;
  }
  // All frames since the last call.
  std::vector<protocol::RobotFrame> received() {
    std::vector<protocol::RobotFrame> frames;
    for (; read_writes < chip.socket.writes.size(); ++read_writes) {
      const std::vector<std::uint8_t>& bytes = chip.socket.writes[read_writes];
      protocol::FrameReader reader;
      protocol::Bytes input{bytes.data(), bytes.size()};
      EXPECT_EQ(reader.push(input), protocol::FrameReader::State::complete) << "a write is one whole frame";
      EXPECT_TRUE(input.empty()) << "a write is one frame only";
      const auto frame = protocol::decode_robot_frame(reader.payload());
      EXPECT_TRUE(frame.has_value());
      if (frame) frames.push_back(*frame);
    }
    return frames;
  }

  // For how long the motor's pin is high while this runs.
  template <typename Action>
  std::uint64_t motor_high_us(Action action) {
    const std::uint64_t before = chip.pins[kMotorPin].high_us;
    action();
    return chip.pins[kMotorPin].high_us - before;
  }

  std::optional<Board> board;
  std::size_t read_writes = 0;
  std::uint64_t last_command_id = 0, known_boot_id = 0;
};

}  // namespace robot_fw::esp8266
