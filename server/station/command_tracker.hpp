// Follows each command from its submission to its end: sent, answered, seen in telemetry, read back, expired.
//
// Every change of a record is published at once, and coroutines that wait for a command are resumed. EmergencyStops
// follows an emergency stop until a robot has acknowledged it; then it is followed here as well. Loop thread.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/station/commands/telemetry_verifier.hpp"
#include "server/station/robot_entry.hpp"
#include "server/station/sink_notifier.hpp"
#include "server/station/state/stop_times.hpp"

namespace server::station {

class CommandTracker {
 public:
  CommandTracker(boost::asio::io_context& loop, runtime::Clock& clock, SinkNotifier& notifier)
      : loop_{loop}, clock_{clock}, notifier_{notifier} {}

  RecentCommands& recent() { return recent_; }  // that had a key, and have ended
  const RecentCommands& recent() const { return recent_; }
  const StopTimes& stop_times() const { return stop_times_; }

  // The command of a request with a key that is on its way already, or was answered lately; null when there is none.
  // invalid when the key was used for another command.
  Result<std::shared_ptr<PendingCommand>> find_same(const CommandRequest& request, const RobotEntry& entry);
  // What became of it, as far as that is known within the patience.
  boost::asio::awaitable<Result<CommandRecord>> follow(std::shared_ptr<PendingCommand> pending, bool until_verified,
                                                       microseconds patience);

  // SAFETY: of setpoints, or duties, an older one that waits for the link does not follow the newer one.
  void supersede_queued(RobotEntry& entry, const PendingCommand& newer);
  void on_sent(RobotEntry& entry, CommandId id);
  // The command that the robot has answered, waiting for its end; null when it is none of the unanswered. What the
  // robot had accepted for later and says now that it has dropped ends here.
  std::shared_ptr<PendingCommand> find_answered(RobotEntry& entry, const protocol::CommandAck& ack);
  // The answer to anything but a stop.
  void on_answer(RobotEntry& entry, PendingCommand& pending, const protocol::CommandAck& ack);
  // The robot has accepted it; its effect is looked for from now on.
  void acknowledge(RobotEntry& entry, CommandId id, std::string reason);
  // An unanswered one ends.
  void finish(RobotEntry& entry, CommandId id, CommandState state, std::string reason);
  void end(PendingCommand& pending, CommandState state, std::string reason);

  void on_samples(RobotEntry& entry, const SampleBatch& batch);
  // A robot sends an acknowledgement before the event of the same command: one that names a command without an answer
  // says that the answer is lost, and that the command has run.
  void on_event(RobotEntry& entry, const protocol::Event& event);
  // What the robot reports to be in force ends the commands that have waited for it.
  void on_read_back(RobotEntry& entry, std::span<const std::shared_ptr<PendingCommand>> sent,
                    std::span<const Sight> sights);
  // With each frame of the robot.
  void expire(RobotEntry& entry);
  // SAFETY: a stop is kept until a robot acknowledges it; everything else ends with the link.
  void end_with_link(RobotEntry& entry, const char* reason);

  // Ends commands that were sent and have no answer, where samples prove what became of them.
  void settle_unanswered(RobotEntry& entry, const SampleBatch& batch);

 private:
  void await_effect(RobotEntry& entry, const std::shared_ptr<PendingCommand>& pending, std::string reason);
  void mark_overtaken(RobotEntry& entry, PendingCommand& pending) const;
  void end_dropped(RobotEntry& entry, const protocol::CommandAck& ack);
  void end_unanswered(RobotEntry& entry, CommandId id, const char* sent_reason, CommandState queued_state,
                      const char* queued_reason);
  void end_without_answer(RobotEntry& entry, CommandId id, const char* reason);
  bool end_if_sighted(PendingCommand& pending, Sight sight);

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  SinkNotifier& notifier_;
  RecentCommands recent_;
  StopTimes stop_times_;
};

}  // namespace server::station
