// The frames to be sent to one robot: their order, and the unsent rest of a frame.
//
// First to last: Welcome, emergency stops, a stop probe, commands, a heartbeat when it is due or requested. Commands
// wait in a bounded queue until the robot has a place for their answer (command_window.hpp), or until their validity
// has passed. Times are steady µs. Pure, on the thread of its owner: no socket, no clock, no station.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <optional>

#include "protocol/frame.hpp"
#include "server/link/command_window.hpp"
#include "server/link/stop_probes.hpp"
#include "server/station/state/station_state.hpp"

namespace server::link {

class RobotOutbox {
 public:
  static constexpr std::size_t kMaxQueuedCommands = 64;  // a further one is refused
  static constexpr std::size_t kMaxQueuedStops = 16;     // a further one takes the place of the oldest

  // Says how many of the bytes the stream took without waiting.
  using Writer = std::function<std::size_t(protocol::Bytes)>;

  explicit RobotOutbox(std::int64_t heartbeat_interval_us)
      : heartbeat_interval_us_{heartbeat_interval_us}, stop_probes_{heartbeat_interval_us} {}

  // The first frame that is written; nothing else is asked for before.
  void welcome(const protocol::Welcome& welcome);
  // To be written before `deadline_us` or not at all; false when the queue is full.
  bool enqueue(const protocol::Command& command, std::int64_t deadline_us);
  bool withdraw(station::CommandId id);  // false when it is not queued (any more)
  // SAFETY: ahead of everything that waits; drops the queued commands, which it supersedes. Never refused.
  void enqueue_stop(const protocol::Command& command);
  // What the following heartbeats say is durable; the next one leaves when something came from the robot.
  void set_durable(std::uint64_t next_seq, std::uint64_t next_event_seq);
  // The next heartbeat, which is due now, asks for these again.
  void request_resend(std::uint64_t first_seq, std::uint64_t next_seq);
  void request_event_resend();

  // What came from the robot: bytes, the time of a frame that follows every answer, an answer, an event of a command.
  void on_received(std::int64_t now_us);
  void on_robot_time(std::uint64_t robot_time_us, std::uint32_t tick_us) {
    window_.robot_time_is(robot_time_us, tick_us);
  }
  void on_ack(const protocol::CommandAck& ack);
  void on_event_of(station::CommandId id) { window_.ended(id); }
  // When they begin, their answers, what they say of the way of a stop.
  StopProbes& stop_probes() { return stop_probes_; }
  const StopProbes& stop_probes() const { return stop_probes_; }
  // False when the probe of the robot's clock that waits for its answer had another stamp.
  bool on_probe_answer(std::uint64_t echo_station_time_us);

  // Something may be due after on_received().
  bool has_work() const { return heartbeat_wanted_ || !commands_.empty(); }
  // An answer to a stop, a command or a probe is still to come.
  bool awaits_answer() const {
    return awaited_stop_ != 0 || awaited_command_ != 0 || probe_us_ != 0 || stop_probes_.awaits_answer();
  }
  std::int64_t next_heartbeat_us() const { return next_heartbeat_us_; }

  struct Written {
    std::optional<station::CommandId> command_id;  // of a command or a stop
  };
  // Writes the frame that is due first; nothing when none is due, or while something is unsent.
  std::optional<Written> write_next(std::int64_t now_us, const Writer& write);
  // What the writer did not take; it must be what the stream is given next.
  protocol::Bytes unsent() const { return unsent_; }
  void unsent_was_written() { unsent_ = {}; }

 private:
  struct QueuedCommand {
    protocol::Command command;
    std::int64_t deadline_us;
  };

  std::optional<protocol::StationFrame> next_frame(std::int64_t now_us);
  bool take_stop(protocol::Command& command);
  bool take_command(std::int64_t now_us, protocol::Command& command);
  protocol::StationHeartbeat take_heartbeat(std::int64_t now_us);

  std::int64_t heartbeat_interval_us_;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> output_{};
  protocol::Bytes unsent_;  // of output_
  std::optional<protocol::Welcome> welcome_;
  std::deque<protocol::Command> stops_;                        // SAFETY: always written first
  station::CommandId awaited_stop_ = 0, awaited_command_ = 0;  // the last that was written and is not answered; 0: none
  StopProbes stop_probes_;
  std::deque<QueuedCommand> commands_;
  CommandWindow window_;                                                        // SAFETY: of all but stops
  protocol::StationHeartbeat heartbeat_ = rheonaut_StationHeartbeat_init_zero;  // the next one, but for the probe
  bool heartbeat_wanted_ = false;                                               // before it is due
  std::int64_t next_heartbeat_us_ = 0;
  std::int64_t next_probe_us_ = 0;
  std::uint64_t probe_us_ = 0;  // the stamp that waits for its answer; 0: none
};

}  // namespace server::link
