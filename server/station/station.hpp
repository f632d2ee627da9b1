// The station as its users see it: the live state of all robots, and the only way in for commands.
//
//   robot sessions → Station → sinks (recorder, live feed, runs)
//   people and scripts → Station::submit → robot session
//
// It consists of parts with one job each, in station_parts.hpp. Loop thread only. Outlives the sessions and everything
// that submits; sinks and the archive outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/config/envelope.hpp"
#include "server/config/link_settings.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/ended_right.hpp"
#include "server/runtime/result.hpp"
#include "server/station/commands/client.hpp"
#include "server/station/commands/requests.hpp"
#include "server/station/commands/reservations.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/station/state/checked.hpp"
#include "server/station/state/clock_sync.hpp"
#include "server/station/state/fluid_model.hpp"
#include "server/station/state/in_force.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/robot_link.hpp"
#include "server/station/state/station_sink.hpp"
#include "server/station/state/station_state.hpp"
#include "server/station/state/stop_times.hpp"

namespace server::station {

struct StationParts;  // server/station/station_parts.hpp

class Station {
 public:
  Station(boost::asio::io_context& loop, runtime::Clock& clock, config::Envelope envelope, config::LinkTimes times);
  ~Station();

  void add_sink(StationSink& sink);

  // What the archive knows, before those robots arrive: its robots, shown as disconnected and latched as they were, and
  // the emergency stops of an earlier run of the station that no robot has acknowledged; and the reservations.
  void restore(const std::vector<RestoredRobot>& robots, const std::vector<CommandRecord>& pending_stops,
               const std::vector<Reservation>& reservations = {});

  const std::map<RobotId, RobotState>& robots() const;
  const RobotState* find(const RobotId& id) const;
  // What the robot has reported last of its parameters and controller; null for a robot that is not known.
  const RobotSettings* settings(const RobotId& id) const;

  // Checks the request, sends it and waits for the robot's answer (acknowledged, rejected, expired, superseded or
  // failed; right after its time to live unknown), or with `until_verified` for the command's end. The record becomes
  // verified by itself. An error means that nothing was sent.
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
  // A sign of life of a client for a robot, whose control stays its own; without a robot for all that it controls,
  // which is for clients without an id. `age`: of what it has seen of the robots.
  void keep_control(const Client& client, const std::optional<RobotId>& robot, microseconds age);
  std::string holder(const RobotId& id) const;                     // of control, now; empty: nobody
  bool is_kept_by(const RobotId& id, const Client& client) const;  // control; or nobody has it
  // SAFETY: what acts in the name of an actor who may command no more ends now: experiments and models (StationSink),
  // control, and commands that wait here or on a robot. A robot that moves in that name is to be brought to rest; so is
  // one that is away, when it is back.
  void end_right(const runtime::EndedRight& right);
  std::set<std::string> acting() const;          // in whose names robots are controlled or moved, or will be
  boost::asio::awaitable<void> watch_control();  // reports when control has ended, until cancelled

  // Whether the reservation may be made: what Reservations::check says. conflict, too: somebody is in control of the
  // robot whom it would keep out within kReservationNotice, and no administrator makes it.
  Result<void> check_reservation(const Reservation& wanted, bool is_by_admin) const;
  // It is on disk, and in force from now on; or it is no longer.
  void add_reservation(const Reservation& made);
  void remove_reservation(ReservationId id, const std::string& cancelled_by);
  const Reservation* find_reservation(ReservationId id) const;  // that is not over; null: none
  // The first one that keeps the actor out of the robot between now and so much later; null: none, or they control the
  // robot by force. SAFETY: what acts in an actor's name ends before.
  const Reservation* reserved_for_another(const RobotId& id, const std::string& actor, microseconds ahead) const;
  std::string account_of(const std::string& actor) const;
  void set_account_of(Reservations::AccountOf account_of);

  // Something was refused before it came to one of the functions above: the audit gets an entry. `what` is "command" or
  // "control", `detail` what is known of the request, as a JSON object.
  void note_refusal(Author by, const RobotId& robot_id, const char* what, std::string detail, const Error& error);

  // The command of a client's key that is on its way, or has ended lately; null when there is none.
  const CommandRecord* known_command(const RobotId& robot_id, CommandId id) const;
  // One that ended before a restart, or long ago: who asks for it again gets this record, and nothing is sent.
  void remember(const CommandRecord& ended);

  const StopTimes& stop_times() const;
  // Round-trip times of the heartbeats of all robots, without the robots' processing time.
  const runtime::TimeHistogram& round_trips() const;
  std::uint64_t invalid_values() const;   // of all robots, since the station started
  std::uint64_t events_left_out() const;  // of all robots, since the station started

  // --- called by robot sessions (link/) ---

  config::LinkTimes link_times() const;
  // Decides whether a robot that is already connected is replaced (same boot) or keeps its place. On admission the
  // session becomes the robot's link, and pending stops are sent to it first.
  Result<void> may_connect(const RobotId& id, BootId boot_id) const;
  void on_connected(RobotLink& link, const AdmissionRequest& hello, const protocol::Hello& details,
                    const Admission& admission, const std::string& peer);
  void on_disconnected(RobotLink& link, const std::string& reason);
  // Somebody who calls itself this robot was not let in: an event, if the robot is known, at most one each 10 s.
  void on_refused(const RobotId& id, const std::string& peer, protocol::RefusalReason reason,
                  const std::string& detail);
  // A robot that is not known could not enrol itself: an event under its name, and a line of the log, at most one each
  // 10 s whatever their names are.
  void on_enrolment_refused(const RobotId& id, const std::string& peer, const std::string& detail);
  void on_frame(RobotLink& link, std::uint64_t robot_time_us);  // any frame: a sign of life
  void on_samples(RobotLink& link, Checked<protocol::Telemetry> telemetry);
  // Acts on it, and has it recorded, unless the robot has sent too many (EventAllowance): those are counted.
  void on_event(RobotLink& link, Checked<protocol::Event> event);
  // Values of a frame that cannot be: counted, and an event of the first of them, at most one each 10 s.
  void on_invalid_values(RobotLink& link, std::uint64_t count, const char* cause, const std::string& first);
  // What came and cannot be recorded is lost for good: else the robot would send it again for ever.
  void on_unusable_samples(RobotLink& link, const protocol::Telemetry& telemetry);
  void on_unusable_event(RobotLink& link, const protocol::Event& event);
  void on_status(RobotLink& link, const protocol::Status& status);
  void on_command_ack(RobotLink& link, const protocol::CommandAck& ack);
  void on_command_sent(RobotLink& link, CommandId id);
  void on_clock(RobotLink& link, const ClockExchange& exchange);
  void on_stop_path(RobotLink& link, const StopPath& path);
  // Somebody watches, controls or commands the robot, or its stop is pending: what it sends is to be seen promptly.
  bool is_attended(const RobotLink& link) const;
  void on_parameters(RobotLink& link, const protocol::ParameterPage& page);
  void on_controller(RobotLink& link, const protocol::Controller& controller);

  // The limits of commands, with the list of fluids.
  const config::Envelope& envelope() const;

  // Says which fluid the robot is in, as Envelope lists it; empty: not known. The limits of that fluid hold from this
  // call on, until another is named. not_found; invalid for a fluid that is not listed; conflict while somebody else is
  // in control.
  Result<void> set_fluid(const RobotId& id, const std::string& fluid, const Author& by);

  // Sends the robot this model of the fluid that is named for it, which no other robot gets. not_found; not_connected;
  // conflict where another fluid or none is named, and while somebody else is in control. The caller writes the audit
  // before, since a reason for a model in doubt must stand there: so it can ask whether it may.
  Result<void> may_send_model(const RobotId& id, const std::string& fluid, const Author& by);
  Result<void> send_model(const RobotId& id, const std::string& fluid, FluidModel model, const Author& by);

  // Called at the end of each set_fluid() of somebody who may command the robot, also when it names the same fluid, and
  // of each send_model() with its model.
  using OnModelWanted = std::function<void(const RobotState&, const Author&, std::optional<FluidModel> own)>;
  void set_on_model_wanted(OnModelWanted on_model_wanted);

  // What has become of the model of the robot's fluid, and an event of that.
  void set_model(const RobotId& id, RobotModel model);
  void note_model(const RobotId& id, const char* kind, const std::string& detail);
  // An event: an experiment was interrupted or paused, for so long from this time of a boot on.
  void note_interruption(const RobotId& id, const BootPart& part, const std::string& reason, const std::string& detail);
  // The event of its beginning, which is left of it when the station is killed.
  void note_pause(const RobotId& id, BootId boot_id, std::uint64_t from_robot_us, const std::string& reason,
                  const std::string& detail);

  // An administrator has retired the robot, or put it back into use (0); the database has it, or is about to.
  void set_retired(const RobotId& id, std::int64_t retired_at_us, const std::string& actor);

  // Ends the robot's connection, if there is one: its enrolment was revoked.
  void end_connection(const RobotId& id, const std::string& reason);

  // --- called when a commit is done (wired by main) ---

  void on_durable(const RobotId& id, BootId boot_id, std::uint64_t durable_next_seq,
                  std::uint64_t durable_next_event_seq);
  void request_resend(const RobotId& id, BootId boot_id, std::uint64_t first_seq, std::uint64_t next_seq);
  void request_event_resend(const RobotId& id, BootId boot_id);
  // The boot came back with this number of samples in this range that were given up.
  void note_returned(const RobotId& id, BootId boot_id, std::uint64_t first_seq, std::uint64_t last_seq,
                     std::uint64_t samples);

 private:
  std::unique_ptr<StationParts> parts_;
};

}  // namespace server::station
