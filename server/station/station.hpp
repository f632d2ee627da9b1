// The centre of the station: the only owner of live state, and the only door for commands.
//
//   robot sessions → Station → sinks (recorder, live feed, runs)
//   people and scripts → Station::submit → robot session
//
// Loop thread only. Outlives the sessions and everything that submits; sinks and the archive outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "server/config/link_settings.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/authority.hpp"
#include "server/station/command_gate.hpp"
#include "server/station/recent_commands.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/station/state/clock_sync.hpp"
#include "server/station/state/in_force.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/robot_port.hpp"
#include "server/station/state/station_sink.hpp"
#include "server/station/state/station_state.hpp"
#include "server/station/state/stop_times.hpp"

namespace server {

// A wish to command a robot. `action` has its action member set; the station fills id, boot and validity.
struct CommandRequest {
  RobotId robot_id;
  protocol::Command action = rheonaut_Command_init_zero;
  std::string arguments = "{}";  // as JSON, for the record
  std::string actor;
  std::string peer;                   // the address that it came from
  microseconds life{2'000'000};       // at most 10 s, from when it was issued
  microseconds age{0};                // it was issued so long before it arrived
  std::string life_from = "arrival";  // how that is known, see CommandRecord
  microseconds unread{0};             // the station stood still: it may have waited for so long before it was read
  std::string key;                    // of the client, new for each wish; a wish that comes again is not sent again
  std::int64_t received_us = 0;       // steady, when it arrived at the station; 0: now
  bool until_verified = false;        // wait for more than the robot's answer
  bool takes_control = true;          // of a robot that nobody controls
};

struct StopRequest {
  RobotId robot_id;
  std::string actor;
  std::string peer;              // as above
  std::string key;               // as above: one press may come by two ways
  std::int64_t received_us = 0;  // as above
};

struct StopsOfAll {
  std::vector<CommandRecord> records;
  std::vector<RobotId> failed;    // the station could not take their stop; its log says why
  std::vector<RobotId> left_out;  // retired and not connected
};

enum class ControlAction : std::uint8_t { take, force, release, request, hand_over };

struct ControlRequest {
  RobotId robot_id;
  std::string actor;
  std::string peer;  // the address that it came from
  ControlAction action = ControlAction::take;
  microseconds life{kControlLife};  // take: without a sign of life; at most kLongestControl
  std::string reason;               // force: why
  microseconds age{0};              // take, force: of what its page saw; above kOldestSight it begins nothing
};

struct PendingCommand;
enum class Sight : std::uint8_t;  // telemetry_verifier.hpp

class Station {
 public:
  Station(boost::asio::io_context& loop, Clock& clock, Envelope envelope, LinkTimes times);
  ~Station();

  void add_sink(StationSink& sink);

  // What the archive knows, before those robots arrive: its robots, shown as disconnected and latched as they were, and
  // the emergency stops of an earlier run of the station that no robot has acknowledged.
  void restore(const std::vector<RestoredRobot>& robots, const std::vector<CommandRecord>& pending_stops);

  const std::map<RobotId, RobotState>& robots() const { return robots_; }
  const RobotState* find(const RobotId& id) const;
  // What the robot has said last of its parameters and controller; null for a robot that is not known.
  const RobotSettings* settings(const RobotId& id) const;

  // The one door. Checks the request, sends it and waits for the robot's answer (acknowledged, rejected, expired,
  // superseded or failed), which comes at most `life` and 2 s later, or with `until_verified` for its end. The record
  // goes on to verified by itself. An error means that nothing was sent.
  boost::asio::awaitable<Result<CommandRecord>> submit(CommandRequest request);

  // SAFETY: the frame is handed to the link before anything else is done; then as submit, but at most `patience`. When
  // the robot is not connected, or does not answer in time, the stop is kept and sent first when it comes back; the
  // record then says queued or sent.
  boost::asio::awaitable<Result<CommandRecord>> emergency_stop(StopRequest request, microseconds patience);

  // SAFETY: the same for every robot: all frames are handed to their links before anything else is done, and a stop
  // that fails keeps no other from being sent. At most `patience` for all of them. The request's robot_id is not looked
  // at. Only a retired robot that is not connected is left out.
  boost::asio::awaitable<StopsOfAll> stop_all(StopRequest request, microseconds patience);

  // Changes who holds control of a robot, see Authority.
  Result<ControlState> control(const ControlRequest& request);
  // A sign of life of an actor: what it controls stays its own. `age`: of what it has seen of the robots.
  void keep_control(const std::string& actor, microseconds age);
  boost::asio::awaitable<void> watch_control();  // says when control has ended, until cancelled

  // Something that was refused before it came to one of the doors above: the audit hears of it. `what` is "command" or
  // "control", `detail` what is known of the wish, as a JSON object.
  void note_refusal(Author by, const RobotId& robot_id, const char* what, std::string detail, const Error& error);

  // The command of a client's key that is on its way, or has ended lately; null when there is none.
  const CommandRecord* known_command(const RobotId& robot_id, CommandId id) const;
  // One that ended before a restart, or long ago: who asks for it again gets this record, and nothing is sent.
  void remember(const CommandRecord& ended) { recent_.put(ended, kLongAgoUs); }

  const StopTimes& stop_times() const { return stop_times_; }
  std::uint64_t invalid_values() const { return invalid_values_; }  // of all robots, since the station started

  // --- called by robot sessions (link/) ---

  LinkTimes link_times() const { return times_; }
  // Decides whether a robot that is already connected is replaced (same boot) or keeps its place. On admission the
  // session becomes the robot's port, and pending stops are sent to it first.
  Result<void> may_connect(const RobotId& id, BootId boot_id) const;
  void on_connected(RobotPort& port, const AdmissionRequest& hello, const protocol::Hello& details,
                    const Admission& admission, const std::string& peer);
  void on_disconnected(RobotPort& port, const std::string& reason);
  // Somebody who calls itself this robot was not let in: an event, if the robot is known, at most one each 10 s.
  void on_refused(const RobotId& id, const std::string& peer, protocol::RefusalReason reason,
                  const std::string& detail);
  // A robot that is not known could not enrol itself: an event under its name, and a line of the log, at most one each
  // 10 s whatever their names are.
  void on_enrolment_refused(const RobotId& id, const std::string& peer, const std::string& detail);
  void on_frame(RobotPort& port, std::uint64_t robot_time_us);  // any frame: a sign of life
  void on_samples(RobotPort& port, const protocol::Telemetry& telemetry);
  void on_event(RobotPort& port, const protocol::Event& event);
  // Values of a frame that cannot be: counted, and an event of the first of them, at most one each 10 s.
  void on_invalid_values(RobotPort& port, std::uint64_t count, const char* cause, const std::string& first);
  // What came and cannot be recorded is lost for good: else the robot would send it again for ever.
  void on_unusable_samples(RobotPort& port, const protocol::Telemetry& telemetry);
  void on_unusable_event(RobotPort& port, const protocol::Event& event);
  void on_status(RobotPort& port, const protocol::Status& status);
  void on_command_ack(RobotPort& port, const protocol::CommandAck& ack);
  void on_command_sent(RobotPort& port, CommandId id);
  void on_clock(RobotPort& port, const ClockExchange& exchange);
  void on_parameters(RobotPort& port, const protocol::ParameterPage& page);
  void on_controller(RobotPort& port, const protocol::Controller& controller);

  // The limits of commands, with the list of fluids.
  const Envelope& envelope() const { return envelope_; }

  // Says which fluid the robot is in, as Envelope lists it; empty: not known. The limits of that fluid hold from this
  // call on, until another is named. not_found; invalid for a fluid that is not listed; conflict while somebody else is
  // in control.
  Result<void> set_fluid(const RobotId& id, const std::string& fluid, const Author& by);

  // Called at the end of each set_fluid() by somebody who may command the robot, also when it names the same fluid.
  using OnFluidNamed = std::function<void(const RobotState&, const Author&)>;
  void set_on_fluid_named(OnFluidNamed on_fluid_named) { on_fluid_named_ = std::move(on_fluid_named); }

  // What has become of the model of the robot's fluid, and an event of that.
  void set_model(const RobotId& id, RobotModel model);
  void note_model(const RobotId& id, const char* kind, const std::string& detail);

  // The value of a parameter that the robot has said in this connection; none while it has not.
  std::optional<float> parameter_in_force(const RobotId& id, const std::string& name) const;

  // An administrator has retired the robot, or put it back into use (0); the database has it, or is about to.
  void set_retired(const RobotId& id, std::int64_t retired_at_us, const std::string& actor);

  // Ends the robot's connection, if there is one: its enrolment was revoked.
  void end_connection(const RobotId& id, const std::string& reason);

  // --- called when a commit is done (wired by main) ---

  void on_durable(const RobotId& id, BootId boot_id, std::uint64_t durable_next_seq,
                  std::uint64_t durable_next_event_seq);
  void request_resend(const RobotId& id, BootId boot_id, std::uint64_t first_seq, std::uint64_t next_seq);
  void request_event_resend(const RobotId& id, BootId boot_id);

 private:
  static Seat* seat_of(const RobotPort& port) { return port.seat_; }  // null when the port's place was taken
  Seat& add_seat(const RobotId& id);
  std::int64_t robot_now_us(const RobotState& robot) const;
  void publish(const RobotState& robot);
  void publish(const CommandRecord& record);
  void note(const RobotState& robot, std::string kind, std::string detail, std::string cause = "none");
  void tell(const Authority::Change& change, const std::string& actor, const std::string& peer);
  std::unexpected<Error> refuse(const CommandRequest& request, Error error);
  void count_power(RobotState& robot, const SampleBatch& batch) const;
  void record_clock(Seat& seat);
  void record_in_force(Seat& seat, std::string kind, std::string content);

  std::shared_ptr<PendingCommand> make_pending(const CommandRequest& request, const RobotState& robot);
  Result<void> may_control(const CommandRequest& request) const;
  Result<void> check_sight(const CommandRequest& request) const;
  void use_control(const CommandRequest& request);
  bool drop_timed(Seat& seat);
  void end_timed(Seat& seat, const char* reason);
  void withdraw_queued(Seat& seat, const char* reason, const std::function<bool(const PendingCommand&)>& is_meant);
  Result<void> check_request(const CommandRequest& request, const protocol::Command& wire, const Seat& seat) const;
  Result<std::shared_ptr<PendingCommand>> same_wish(const CommandRequest& request, const Seat& seat);
  boost::asio::awaitable<Result<CommandRecord>> follow(std::shared_ptr<PendingCommand> pending, bool until_verified,
                                                       microseconds patience);
  void add_pending(Seat& seat, const std::shared_ptr<PendingCommand>& pending);
  void supersede_queued(Seat& seat, const PendingCommand& newer);
  void acknowledge(Seat& seat, CommandId id, std::string reason);
  void finish(Seat& seat, CommandId id, CommandState state, std::string reason);
  void end(PendingCommand& pending, CommandState state, std::string reason);
  void expire_commands(Seat& seat);
  void look_for_commands(Seat& seat, const SampleBatch& batch);
  void end_unseen(Seat& seat, const char* reason);
  void settle_read_back(Seat& seat, const std::vector<std::shared_ptr<PendingCommand>>& sent,
                        const std::vector<Sight>& sights);
  void end_dropped(Seat& seat, const protocol::CommandAck& ack);
  void prepare_proof(Seat& seat, PendingCommand& pending);
  void end_without_answer(Seat& seat, CommandId id, const char* reason);
  static std::shared_ptr<PendingCommand> reopen(Seat& seat, CommandId id);
  void settle_by_event(Seat& seat, const protocol::Event& event);
  void settle_by_samples(Seat& seat, const SampleBatch& batch);

  void restore_fluid(RobotState& robot, const std::string& fluid) const;
  void restore_stop(const CommandRecord& record);
  std::shared_ptr<PendingCommand> begin_stop(Seat& seat, const StopRequest& request);
  bool may_be_left_out(const Seat& seat) const;
  void publish_held_back(std::vector<RobotId>& failed);
  std::shared_ptr<PendingCommand> stop_in_force(Seat& seat, const StopRequest& request);
  void hand_stop_to(Seat& seat, PendingCommand& stop);
  void repeat_stop(Seat& seat);
  void settle_stops(Seat& seat, const PendingCommand& acknowledged, const protocol::CommandAck& ack);

  boost::asio::io_context& loop_;
  Clock& clock_;
  const std::int64_t started_us_ = clock_.steady_us();
  Envelope envelope_;
  LinkTimes times_;
  std::map<RobotId, RobotState> robots_;
  std::map<RobotId, Seat> seats_;  // one for each robot, connected or not
  SampleBatch batch_;              // of the frame that is being taken; kept for its memory
  std::vector<StationSink*> sinks_;
  OnFluidNamed on_fluid_named_ = [](const RobotState&, const Author&) {};
  Authority authority_;
  RecentCommands recent_;  // that had a key, and have ended
  StopTimes stop_times_;
  std::uint64_t invalid_values_ = 0;
  std::int64_t enrolment_told_at_us_ = 0;                // steady; 0: never
  std::uint64_t enrolments_untold_ = 0;                  // since
  std::optional<std::vector<CommandRecord>> held_back_;  // while all robots are being stopped
};

}  // namespace server
