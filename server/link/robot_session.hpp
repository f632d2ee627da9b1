// One connection of a robot, from the hello until the link is lost: decides when to read, write and close it.
//
//   Hello → (Station::may_connect, RobotArchive::admit) → Welcome → { reader ‖ writer ‖ watch }
//
// greeting.hpp has the greeting, robot_outbox.hpp decides what is sent next. Loop thread. Owns its stream;
// lives in the coroutine RobotListener::session and is the Station's RobotLink while it is welcome.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <memory>
#include <optional>
#include <string>

#include "protocol/frame.hpp"
#include "server/link/greeting.hpp"
#include "server/link/robot_outbox.hpp"
#include "server/net/byte_stream.hpp"
#include "server/runtime/clock.hpp"
#include "server/station/state/frame_faults.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/robot_link.hpp"
#include "server/station/station.hpp"

namespace server::link {

// Shared by all sessions, since each handles at once what it reads: memory that is in the processor's cache.
struct ReadBuffers {
  std::array<std::uint8_t, net::ByteStream::kReadBytes> input;
  protocol::RobotFrame frame;
};

class RobotSession final : public station::RobotLink {
 public:
  static constexpr std::chrono::seconds kHelloTime{5};

  RobotSession(boost::asio::io_context& loop, runtime::Clock& clock, std::unique_ptr<net::ByteStream> stream,
               station::Station& station, station::RobotArchive& archive, ReadBuffers& buffers);
  ~RobotSession() override;

  // Hello to Welcome; false when the robot was refused or said nothing. Then serve() to the end of the connection.
  boost::asio::awaitable<bool> greet();
  const std::string& why_unwelcome() const { return close_reason_; }  // after greet() was false
  boost::asio::awaitable<void> serve();  // throws what the connection ended by, if that was an exception

  const station::RobotId& robot_id() const override { return robot_id_; }
  bool send(const protocol::Command& command, std::int64_t deadline_us) override;
  bool withdraw(station::CommandId id) override;
  void send_emergency_stop(const protocol::Command& command) override;
  void acknowledge(std::uint64_t durable_next_seq, std::uint64_t durable_next_event_seq) override;
  void request_resend(std::uint64_t first_seq, std::uint64_t next_seq) override;
  void request_event_resend() override;
  void close(const std::string& reason) override;

 private:
  using EndReason = std::string;

  void read();
  void on_bytes(protocol::Bytes unread);
  bool decode_next_of(protocol::Bytes& unread);
  void on_hello(const protocol::RobotFrame& frame);
  boost::asio::awaitable<bool> admit(const protocol::Hello& hello);
  std::optional<Refusal> refusal_if_connected(const protocol::Hello& hello) const;
  boost::asio::awaitable<bool> refuse(Refusal refusal);

  boost::asio::awaitable<EndReason> part(boost::asio::awaitable<EndReason> task);
  boost::asio::awaitable<EndReason> read_frames();
  boost::asio::awaitable<EndReason> write_frames();
  boost::asio::awaitable<EndReason> watch_link();

  void on_frame(protocol::RobotFrame& frame);
  void report_unusable(const protocol::RobotFrame& frame);
  void on_heartbeat(const protocol::RobotFrame& frame);
  void on_stop_probe_answer(const protocol::StopProbeAnswer& answer);
  void report_stop_path();
  void flush();
  void update_read_pace();
  void stay_prompt(std::int64_t duration_us);

  runtime::Clock& clock_;
  std::unique_ptr<net::ByteStream> stream_;
  station::Station& station_;
  station::RobotArchive& archive_;

  protocol::FrameReader reader_;
  ReadBuffers& buffers_;
  std::vector<std::uint8_t> after_hello_;  // what came with it
  std::exception_ptr failure_;             // that ended a part of the session
  std::optional<protocol::Hello> hello_;
  std::uint64_t hello_robot_time_us_ = 0;
  station::RobotId claimed_id_;  // of a well-formed hello, whether the robot is admitted or not
  station::RobotId robot_id_;    // from the hello
  station::FrameReach reach_;    // of the next frame

  runtime::Signal reading_paused_;  // the hello has come, or a reason to close
  runtime::Signal wake_writer_;     // something is ready that flush() could not write
  RobotOutbox outbox_;

  station::StopPath stop_path_;  // as the station has it

  std::int64_t last_received_us_ = 0;
  std::int64_t prompt_until_us_ = 0;              // what comes is read promptly, even if nobody waits for it
  std::optional<std::int64_t> writing_since_us_;  // while there is something unsent
  std::string close_reason_;
};

}  // namespace server::link
