// A robot made by hand for tests of the link: sends what the test gives it and keeps what the station sends.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "server/net/byte_stream.hpp"
#include "server/runtime/tasks.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/station_sink.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server::link {
class RobotListener;
}  // namespace server::link

namespace server {

// Admits everyone by default; keeps the requests.
class FakeArchive final : public station::RobotArchive {
 public:
  boost::asio::awaitable<station::Admission> admit(station::AdmissionRequest request) override {
    requests.push_back(request);
    co_return answer;
  }

  station::Admission answer;
  std::vector<station::AdmissionRequest> requests;
};

// Keeps everything that it is notified of.
class RecordingSink final : public station::StationSink {
 public:
  void on_robot(const station::RobotState& robot) override { robots.push_back(robot); }
  void on_samples(const station::RobotState&, const station::SampleBatch& batch) override { batches.push_back(batch); }
  void on_event(const station::RobotState&, const station::RobotEvent& event) override { events.push_back(event); }
  void on_command(const station::CommandRecord& record) override { commands.push_back(record); }
  void on_clock(const station::RobotState&, const station::ClockRecord& record) override { clocks.push_back(record); }
  void on_in_force(const station::RobotState&, const station::InForceRecord& record) override {
    in_force.push_back(record);
  }

  std::vector<station::RobotState> robots;
  std::vector<station::SampleBatch> batches;
  std::vector<station::RobotEvent> events;
  std::vector<station::CommandRecord> commands;
  std::vector<station::ClockRecord> clocks;
  std::vector<station::InForceRecord> in_force;
};

class TestRobot {
 public:
  TestRobot(boost::asio::io_context& loop, runtime::Clock& clock, runtime::TaskGroup& tasks,
            link::RobotListener& listener, std::size_t capacity_bytes = 64 * 1024);

  static protocol::RobotFrame hello_frame(protocol::Mode mode = rheonaut_MODE_MANUAL);
  // At rest, in manual or in this emergency.
  static protocol::RobotFrame samples_frame(std::uint64_t first_seq, pb_size_t count, std::uint64_t robot_time_us,
                                            std::uint64_t emergency_id);

  void send(protocol::RobotFrame frame);  // stamps robot_time_us when it is 0
  void send_bytes(std::vector<std::uint8_t> bytes);
  void say_hello() { send(hello_frame()); }
  void send_samples(std::uint64_t first_seq, pb_size_t count, std::uint64_t robot_time_us, std::uint64_t emergency_id) {
    send(samples_frame(first_seq, count, robot_time_us, emergency_id));
  }
  void acknowledge(const protocol::Command& command, protocol::CommandResult result, std::uint64_t emergency_id = 0,
                   protocol::RejectReason reason = rheonaut_REJECT_REASON_NONE);
  void keep_talking();  // a heartbeat every 200 ms

  std::uint64_t robot_now_us() const { return static_cast<std::uint64_t>(clock_.steady_us() - booted_at_us); }

  // What arrived, of one kind.
  std::vector<protocol::Welcome> welcomes() const;
  std::vector<protocol::Command> commands() const;
  std::vector<protocol::StationHeartbeat> heartbeats() const;

  net::MemoryLink link;
  std::int64_t booted_at_us;
  bool reading = true;  // false: nothing is taken from the link any more
  bool closed = false;  // the station ended the stream
  std::vector<protocol::StationFrame> frames;

 private:
  boost::asio::awaitable<void> read();
  boost::asio::awaitable<void> write(std::vector<std::uint8_t> bytes);
  boost::asio::awaitable<void> talk();

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  runtime::TaskGroup& tasks_;
  std::unique_ptr<net::ByteStream> stream_;
};

}  // namespace server
