// One connection of a robot: hello and welcome, then frames both ways until the link is lost.
//
//   Hello → (Station::may_connect, RobotArchive::admit) → Welcome → { reader ‖ writer ‖ watch }
//
// Loop thread. Owns its stream; lives in the frame of run_robot_session and is the Station's RobotPort while welcomed.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "protocol/frame.hpp"
#include "server/link/command_window.hpp"
#include "server/link/frame_faults.hpp"
#include "server/net/byte_stream.hpp"
#include "server/runtime/clock.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/robot_port.hpp"
#include "server/station/station.hpp"

namespace server {

// Of all sessions, since each works off at once what it reads: memory that is in the processor's cache.
struct ReadBuffers {
  std::array<std::uint8_t, ByteStream::kReadBytes> input;
  protocol::RobotFrame frame;
};

class RobotSession final : public RobotPort {
 public:
  static constexpr std::size_t kMaxQueuedCommands = 64;  // a further one is refused
  static constexpr std::size_t kMaxQueuedStops = 16;     // a further one takes the place of the oldest
  static constexpr std::chrono::seconds kHelloTime{5};

  RobotSession(boost::asio::io_context& loop, Clock& clock, std::unique_ptr<ByteStream> stream, Station& station,
               RobotArchive& archive, ReadBuffers& buffers);
  ~RobotSession() override;

  // Hello to Welcome; false when the robot was refused or said nothing. Then serve() to the end of the connection.
  boost::asio::awaitable<bool> greet();
  const std::string& why_unwelcome() const { return close_reason_; }  // after greet() was false
  boost::asio::awaitable<void> serve();  // throws what the connection ended by, if that was an exception

  const RobotId& robot_id() const override { return robot_id_; }
  bool send(const protocol::Command& command, std::int64_t deadline_us) override;
  bool withdraw(CommandId id) override;
  void send_emergency_stop(const protocol::Command& command) override;
  void acknowledge(std::uint64_t durable_next_seq, std::uint64_t durable_next_event_seq) override;
  void request_resend(std::uint64_t first_seq, std::uint64_t next_seq) override;
  void request_event_resend() override;
  void close(const std::string& reason) override;

 private:
  struct QueuedCommand {
    protocol::Command command;
    std::int64_t deadline_us;
  };
  using EndReason = std::string;

  void read();
  void work_off(protocol::Bytes unread);
  bool decode_next_of(protocol::Bytes& unread);
  void on_hello(const protocol::RobotFrame& frame);
  boost::asio::awaitable<bool> admit(const protocol::Hello& hello);
  protocol::StationFrame welcome(const Admission& admission) const;
  boost::asio::awaitable<bool> refuse(protocol::RefusalReason reason, std::string detail);

  boost::asio::awaitable<EndReason> part(boost::asio::awaitable<EndReason> task);
  boost::asio::awaitable<EndReason> read_frames();
  boost::asio::awaitable<EndReason> write_frames();
  boost::asio::awaitable<EndReason> watch_link();

  void on_frame(protocol::RobotFrame& frame);
  void give_up(const protocol::RobotFrame& frame);
  void on_heartbeat(const protocol::RobotFrame& frame);
  void flush();
  void tell_what_is_awaited();
  std::optional<protocol::StationFrame> next_frame();
  protocol::StationFrame heartbeat();

  Clock& clock_;
  std::unique_ptr<ByteStream> stream_;
  Station& station_;
  RobotArchive& archive_;

  protocol::FrameReader reader_;
  ReadBuffers& buffers_;
  std::vector<std::uint8_t> after_hello_;  // what came with it
  std::exception_ptr failure_;             // that ended a part of the session
  std::optional<protocol::Hello> hello_;
  std::uint64_t hello_robot_time_us_ = 0;
  RobotId claimed_id_;  // of a well-formed hello, whether the robot is admitted or not
  RobotId robot_id_;    // from the hello
  FrameReach reach_;    // of the next frame

  Signal reading_paused_;  // the hello has come, or a reason to close
  Signal wake_writer_;     // something is ready that flush() could not write
  std::array<std::uint8_t, protocol::kMaxFramedBytes> output_{};
  protocol::Bytes unsent_;  // of output_: the rest of a frame that the stream did not take at once
  std::optional<protocol::StationFrame> welcome_;     // the first frame that is written
  std::deque<protocol::Command> stops_;               // SAFETY: always written first
  CommandId awaited_stop_ = 0, awaited_command_ = 0;  // the last that was written and is not answered; 0: none
  std::deque<QueuedCommand> commands_;
  CommandWindow window_;  // SAFETY: of all but stops
  protocol::StationHeartbeat durable_ = rheonaut_StationHeartbeat_init_zero;
  bool heartbeat_wanted_ = false;  // before it is due
  std::int64_t next_heartbeat_us_ = 0;
  std::int64_t next_probe_us_ = 0;
  std::uint64_t probe_us_ = 0;  // the stamp that waits for its answer; 0: none

  std::int64_t last_received_us_ = 0;
  std::optional<std::int64_t> writing_since_us_;  // while there is something unsent
  std::string close_reason_;
};

}  // namespace server
