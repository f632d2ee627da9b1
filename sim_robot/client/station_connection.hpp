// The robot's end of a connection to a station, TCP or TLS: dials for ever, reads as bytes arrive, writes without
// waiting.
//
// A Speaker speaks over it: a simulated robot, or a recording that is replayed. The part of a frame that the socket
// does not take at once stays here, and the speaker is asked for the next frame once it is sent. redial.hpp decides
// when to dial again after a failure.
// One buffer serves the reads of all connections of a thread. The loop and the speaker must outlive the connection.
#pragma once

#include <array>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "protocol/frame.hpp"
#include "sim_robot/client/dialling.hpp"
#include "sim_robot/client/station_socket.hpp"
#include "sim_robot/network/redial.hpp"

namespace sim_robot {

// Log lines about the link.
using LinkLog = std::function<void(const std::string& line)>;

class Speaker {
 public:
  virtual void on_opened() = 0;
  virtual void on_closed() = 0;
  // False when the connection is to be closed.
  virtual bool on_bytes(protocol::Bytes bytes) = 0;
  // The frame due first, whole, as Robot::transmit(); 0 when none is.
  virtual std::size_t next_frame(std::uint8_t* out, std::size_t capacity) = 0;
  // The station has admitted the robot, over the present or last connection.
  virtual bool is_welcome() const = 0;
  virtual protocol::RefusalReason refusal() const = 0;
  virtual std::string refusal_detail() const = 0;
  // False once samples are lost while there is no connection: frequent dialling gains nothing then.
  virtual bool ring_has_room() const = 0;
  // Whether to dial now; asked again every 10 ms.
  virtual bool may_dial() const { return true; }
  // Whether to read now what has arrived; asked again every 10 ms.
  virtual bool is_listening() const { return true; }
  // How long until a new connection is open; empty: the connection is no longer needed.
  virtual std::optional<std::chrono::milliseconds> begin_handshake() { return std::chrono::milliseconds(0); }

 protected:
  ~Speaker() = default;
};

// The results of the connections so far.
struct LinkCounts {
  std::uint64_t unreachable = 0;  // attempts without a connection
  std::uint64_t opened = 0;
  std::uint64_t welcomes = 0;
  std::uint64_t refusals = 0;
  std::uint64_t frames = 0;  // sent
};

class StationConnection {
 public:
  // `name` is for the log, which may be empty.
  StationConnection(boost::asio::io_context& loop, Speaker& speaker, StationAddress station, std::string name,
                    LinkLog log);

  // Dials and reads until cancelled. Never returns otherwise.
  boost::asio::awaitable<void> run();

  // Takes the next due frame from the speaker, unless one is still being sent. True when there is one to write.
  bool prepare();
  // Writes what the socket takes without waiting, one write per frame.
  void flush();
  // Closes the connection of a silent station, unless bytes from it wait to be read.
  void close_as_silent();
  // The speaker has rebooted: the socket stays open, and nothing is sent over it.
  void forget();
  // Resets the connection of before the reboot.
  void reset_forgotten();

  bool is_open() const { return is_open_; }
  const LinkCounts& counts() const { return counts_; }
  const std::string& refusal() const { return refusal_; }  // the last one, as the log says it; empty: none

 private:
  boost::asio::awaitable<bool> shake_hands();
  boost::asio::awaitable<void> serve();
  bool take_bytes();
  bool write();
  void close();
  void notice_welcome();
  void say_how_it_ended();
  void say(const std::string& line);

  Speaker& speaker_;
  StationAddress station_;
  std::string name_;
  LinkLog log_;
  StationSocket socket_;
  std::optional<boost::asio::ip::tcp::socket> forgotten_;
  int times_forgotten_ = 0;
  bool is_open_ = false;
  bool was_welcome_ = false;  // on this connection
  LinkCounts counts_;
  std::string refusal_, last_line_;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> frame_;  // under way
  std::size_t frame_size_ = 0, frame_sent_ = 0;
  Redial redial_;
  std::minstd_rand jitter_{std::random_device{}()};
};

}  // namespace sim_robot
