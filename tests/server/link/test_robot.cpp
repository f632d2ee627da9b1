// The hand-made robot.
#include "tests/server/link/test_robot.hpp"

#include <algorithm>

#include "server/link/robot_listener.hpp"
#include "tests/server/stream_reader.hpp"

namespace server {
namespace asio = boost::asio;

TestRobot::TestRobot(asio::io_context& loop, runtime::Clock& clock, runtime::TaskGroup& tasks,
                     link::RobotListener& listener, std::size_t capacity_bytes)
    : link{loop, capacity_bytes},
      booted_at_us{clock.steady_us() - 5'000'000},
      loop_{loop},
      clock_{clock},
      tasks_{tasks},
      stream_{link.take_first()} {
  listener.serve(link.take_second());
  tasks_.spawn("test robot reads", read());
}

protocol::RobotFrame TestRobot::hello_frame(protocol::Mode mode) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_hello_tag;
  protocol::Hello& hello = frame.body.hello;
  hello.protocol_version = protocol::kProtocolVersion;
  std::copy_n("r1", 3, hello.robot_id);
  hello.boot_id = 77;
  hello.sample_period_us = 10'000;
  hello.ring_capacity = 800;
  hello.mode = mode;
  return frame;
}

void TestRobot::send(protocol::RobotFrame frame) {
  if (frame.robot_time_us == 0) frame.robot_time_us = robot_now_us();
  std::vector<std::uint8_t> bytes(protocol::kMaxFramedBytes);
  bytes.resize(protocol::write_frame(frame, bytes.data(), bytes.size()));
  send_bytes(std::move(bytes));
}

void TestRobot::send_bytes(std::vector<std::uint8_t> bytes) {
  tasks_.spawn("test robot writes", write(std::move(bytes)));
}

protocol::RobotFrame TestRobot::samples_frame(std::uint64_t first_seq, pb_size_t count, std::uint64_t robot_time_us,
                                              std::uint64_t emergency_id) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_telemetry_tag;
  protocol::Telemetry& batch = frame.body.telemetry;
  batch.first_seq = first_seq;
  batch.first_robot_time_us = robot_time_us;
  batch.period_us = 10'000;
  batch.mode = emergency_id == 0 ? rheonaut_MODE_MANUAL : rheonaut_MODE_EMERGENCY;
  batch.emergency_id = emergency_id;
  batch.position_m_count = batch.velocity_m_s_count = batch.acceleration_m_s2_count = count;
  batch.duty_count = batch.impedance_mv_count = batch.reference_m_count = count;
  for (pb_size_t i = 0; i < count; ++i) batch.position_m[i] = static_cast<float>(first_seq + i);
  return frame;
}

void TestRobot::acknowledge(const protocol::Command& command, protocol::CommandResult result,
                            std::uint64_t emergency_id, protocol::RejectReason reason) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_command_ack_tag;
  frame.body.command_ack.command_id = command.command_id;
  frame.body.command_ack.result = result;
  frame.body.command_ack.reason = reason;
  frame.body.command_ack.emergency_id = emergency_id;
  frame.body.command_ack.effect_at_robot_us = robot_now_us();
  send(frame);
}

void TestRobot::keep_talking() { tasks_.spawn("test robot talks", talk()); }

asio::awaitable<void> TestRobot::talk() {
  constexpr std::chrono::milliseconds kInterval{200};
  for (;;) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
    send(frame);
    co_await clock_.sleep_for(kInterval);
  }
}

asio::awaitable<void> TestRobot::read() {
  protocol::FrameReader reader;
  std::array<std::uint8_t, 2048> bytes;
  while (reading) {
    const std::size_t size = co_await read_some(loop_, *stream_, asio::buffer(bytes));
    if (size == 0) break;
    protocol::Bytes input{bytes.data(), size};
    while (reader.push(input) == protocol::FrameReader::State::complete) {
      const auto frame = protocol::decode_station_frame(reader.payload());
      if (frame) frames.push_back(*frame);
      if (input.empty()) break;
    }
  }
  closed = reading;
}

asio::awaitable<void> TestRobot::write(std::vector<std::uint8_t> bytes) {
  co_await stream_->write(asio::buffer(bytes));
}

std::vector<protocol::Welcome> TestRobot::welcomes() const {
  std::vector<protocol::Welcome> found;
  for (const auto& frame : frames) {
    if (frame.which_body == rheonaut_StationFrame_welcome_tag) found.push_back(frame.body.welcome);
  }
  return found;
}

std::vector<protocol::Command> TestRobot::commands() const {
  std::vector<protocol::Command> found;
  for (const auto& frame : frames) {
    if (frame.which_body == rheonaut_StationFrame_command_tag) found.push_back(frame.body.command);
  }
  return found;
}

std::vector<protocol::StationHeartbeat> TestRobot::heartbeats() const {
  std::vector<protocol::StationHeartbeat> found;
  for (const auto& frame : frames) {
    if (frame.which_body == rheonaut_StationFrame_heartbeat_tag) found.push_back(frame.body.heartbeat);
  }
  return found;
}

}  // namespace server
