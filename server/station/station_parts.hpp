// The parts behind Station, each with one job, and the state that they share.
//
// Private to the Station's own files. A part declared later may use those before it.
#pragma once

#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/config/envelope.hpp"
#include "server/config/link_settings.hpp"
#include "server/station/command_authority.hpp"
#include "server/station/command_tracker.hpp"
#include "server/station/emergency_stops.hpp"
#include "server/station/robot_table.hpp"
#include "server/station/sink_notifier.hpp"
#include "server/station/state/fluid_model.hpp"
#include "server/station/timed_commands.hpp"

namespace server::station {

struct StationParts {
  StationParts(boost::asio::io_context& its_loop, runtime::Clock& its_clock, config::Envelope limits,
               config::LinkTimes link_times)
      : loop{its_loop}, clock{its_clock}, envelope{std::move(limits)}, times{link_times} {}

  const config::CommandLimits& limits_of(const RobotState& robot) const { return envelope.in(robot.fluid); }
  // SAFETY: timed commands of the former holder of control are dropped before the next command; false: do not send it.
  bool drop_outdated(RobotEntry& entry) { return timed.drop_outdated(entry, control.client_of(entry.robot.id)); }

  // A change of control has been decided: what it ends is dropped, and everybody is notified.
  void publish(const Authority::Change& change, const std::string& actor, const std::string& peer);
  // What the robot does, or is about to do, in the name of somebody whose right has ended.
  void end_right(RobotEntry& entry, const runtime::EndedRight& right);
  // The robot's fluid is another one, whose limits are narrower: ends what they would refuse. False: it moves on, since
  // the order to rest cannot be sent.
  bool end_beyond_limits(RobotEntry& entry);
  // Adds those in whose names end_right() would end something.
  void add_acting(const RobotEntry& entry, std::set<std::string>& actors) const;
  // Publishes the ends of control that time or a reservation has brought.
  void end_control();
  // Publishes the robots whose running reservation is another one than was shown last.
  void show_reservations();
  // SAFETY: runs `act`, which hands stops to a link, and then publishes each record that it made and, if there is one,
  // `robot`; also when `act` or a sink throws: a stop must be known after a restart. The first exception goes on then.
  void publish_stops_of(const std::function<void(std::vector<CommandRecord>& made)>& act,
                        const RobotState* robot = nullptr);
  // What was refused, for the audit; `detail` as a JSON object.
  void publish_refusal(Author by, const RobotId& robot_id, const char* what, const std::string& detail,
                       const Error& error);
  // Keeps an event of the robot that is too many now, in place of an earlier one of its kind.
  void hold(RobotEntry& entry, protocol::EventKind kind, RobotEvent event);
  // Has those recorded for which there is room now, or all.
  void record_held(RobotEntry& entry, bool all);
  // Has the robot's connection recorded, unless it has had too many and it need not be at once: then it waits.
  void record_connection(RobotEntry& entry, bool at_once);
  // The robot's connection is over. False: it was not recorded and is counted, so its end is not to be recorded either.
  bool end_of_recorded(RobotEntry& entry);
  // Of all robots: what waits is recorded when it may be, and how much was left out, at most once in 10 s; at the end
  // all of it.
  void record_waiting(bool is_end);
  std::unexpected<Error> refuse(const CommandRequest& request, Error error);

  boost::asio::io_context& loop;
  runtime::Clock& clock;
  const config::Envelope envelope;
  const config::LinkTimes times;
  SinkNotifier notifier{clock};
  RobotTable robots;
  CommandAuthority control{clock};
  CommandTracker tracker{loop, clock, notifier};
  EmergencyStops stops{loop, clock, tracker.recent()};
  TimedCommands timed{loop, clock, notifier, tracker};
  EventLimit enrolment_refusals{kEventPeriodUs};  // of robots that are not known, whatever their names are
  // Of all robots, since the station started.
  std::uint64_t invalid_values = 0;
  std::uint64_t events_left_out = 0;
  runtime::TimeHistogram round_trips;
  SampleBatch batch;  // of the frame that is being received; kept for its memory
  std::function<void(const RobotState&, const Author&, std::optional<FluidModel> own)> on_model_wanted =
      [](const RobotState&, const Author&, const std::optional<FluidModel>&) {};

 private:
  void leave_out(RobotEntry& entry, std::uint64_t event_seq);
  void report_left_out(RobotEntry& entry, bool at_once);
  std::string left_out_text(const LeftOutCount::Report& left_out) const;
};

}  // namespace server::station
