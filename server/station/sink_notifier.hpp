// Notifies the sinks of everything that happens: the recorder, the live feed, the runs.
//
// Sinks are called in the order in which they were added, and outlive this. Their exceptions reach the caller.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/station/state/station_sink.hpp"

namespace server::station {

class SinkNotifier {
 public:
  explicit SinkNotifier(runtime::Clock& clock) : clock_{clock} {}

  void add(StationSink& sink) { sinks_.push_back(&sink); }

  void publish(const RobotState& robot);
  void publish(const CommandRecord& record);
  void publish(const AuditNote& audit);
  void publish(const RobotState& robot, const SampleBatch& batch);
  void publish(const RobotState& robot, const RobotEvent& event);
  void publish(const RobotState& robot, const ClockRecord& record);
  void publish(const RobotState& robot, const InForceRecord& record);
  void publish_stop_again(const CommandRecord& in_force);
  void publish_right_ended(const runtime::EndedRight& right);
  void publish_rest_owed(const RobotState& robot, const runtime::EndedRight& right);
  void publish_fluid(const RobotState& robot);
  void publish_unusable_samples(const RobotState& robot, std::uint64_t first_seq, std::uint64_t next_seq);
  void publish_unusable_event(const RobotState& robot, std::uint64_t event_seq);
  void publish_event_left_out(const RobotState& robot, std::uint64_t event_seq);

  bool is_watched(const RobotId& id) const;  // by one of them

  // An event of the station itself about a robot. Its kind has a row in docs/database.md: tests/check_docs.py compares
  // the table with the literals of the calls.
  void note(const RobotState& robot, std::string kind, std::string detail, std::string cause = "none");
  // The same of a stretch of time that is over, or has just begun: of no length.
  void note_part(const RobotState& robot, std::string kind, std::string detail, std::string cause,
                 const BootPart& part);

 private:
  RobotEvent event_about(const RobotState& robot, std::string kind, std::string detail, std::string cause) const;
  template <class Call>
  void each(const runtime::EndedRight& right, Call call);

  runtime::Clock& clock_;
  std::vector<StationSink*> sinks_;
};

}  // namespace server::station
