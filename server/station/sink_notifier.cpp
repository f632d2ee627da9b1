#include "server/station/sink_notifier.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "server/runtime/exceptions.hpp"
#include "server/station/state/unknown_values.hpp"

namespace server::station {

void SinkNotifier::publish(const RobotState& robot) {
  for (StationSink* sink : sinks_) sink->on_robot(robot);
}

void SinkNotifier::publish(const CommandRecord& record) {
  for (StationSink* sink : sinks_) sink->on_command(record);
}

void SinkNotifier::publish_stop_again(const CommandRecord& in_force) {
  for (StationSink* sink : sinks_) sink->on_stop_again(in_force);
}

void SinkNotifier::publish(const AuditNote& audit) {
  for (StationSink* sink : sinks_) sink->on_audit(audit);
}

void SinkNotifier::publish(const RobotState& robot, const SampleBatch& batch) {
  for (StationSink* sink : sinks_) sink->on_samples(robot, batch);
}

void SinkNotifier::publish(const RobotState& robot, const RobotEvent& event) {
  for (StationSink* sink : sinks_) sink->on_event(robot, event);
}

void SinkNotifier::publish(const RobotState& robot, const ClockRecord& record) {
  for (StationSink* sink : sinks_) sink->on_clock(robot, record);
}

void SinkNotifier::publish(const RobotState& robot, const InForceRecord& record) {
  for (StationSink* sink : sinks_) sink->on_in_force(robot, record);
}

// SAFETY: a sink that fails keeps no other one, and no robot, from what is to end.
template <class Call>
void SinkNotifier::each(const runtime::EndedRight& right, Call call) {
  for (StationSink* sink : sinks_) {
    try {
      call(*sink);
    } catch (const std::exception& error) {
      spdlog::error("what ends with a right ({}): {}", right.why, runtime::text_of(error));
    }
  }
}

void SinkNotifier::publish_right_ended(const runtime::EndedRight& right) {
  each(right, [&right](StationSink& sink) { sink.on_right_ended(right); });
}

void SinkNotifier::publish_rest_owed(const RobotState& robot, const runtime::EndedRight& right) {
  each(right, [&robot, &right](StationSink& sink) { sink.on_rest_owed(robot, right); });
}

void SinkNotifier::publish_fluid(const RobotState& robot) {
  for (StationSink* sink : sinks_) sink->on_fluid(robot);
}

void SinkNotifier::publish_unusable_samples(const RobotState& robot, std::uint64_t first_seq, std::uint64_t next_seq) {
  for (StationSink* sink : sinks_) sink->on_unusable_samples(robot, first_seq, next_seq);
}

void SinkNotifier::publish_unusable_event(const RobotState& robot, std::uint64_t event_seq) {
  for (StationSink* sink : sinks_) sink->on_unusable_event(robot, event_seq);
}

bool SinkNotifier::is_watched(const RobotId& id) const {
  return std::ranges::any_of(sinks_, [&id](const StationSink* sink) { return sink->watches(id); });
}

void SinkNotifier::publish_event_left_out(const RobotState& robot, std::uint64_t event_seq) {
  for (StationSink* sink : sinks_) sink->on_event_left_out(robot, event_seq);
}

RobotEvent SinkNotifier::event_about(const RobotState& robot, std::string kind, std::string detail,
                                     std::string cause) const {
  RobotEvent event;
  event.robot_id = robot.id;
  event.boot_id = robot.boot_id;
  event.kind = std::move(kind);
  event.cause = std::move(cause);
  event.detail = std::move(detail);
  event.emergency_id = robot.context.emergency_id;
  event.emergency_cause = robot.context.emergency_cause;
  event.unknown_values = unknown_values(robot.context);
  event.mode = robot.context.mode;
  event.sub_state = robot.context.sub_state;
  event.robot_time_us = robot.latest_robot_time_us;
  event.received_at_us = clock_.utc_us();
  return event;
}

void SinkNotifier::note(const RobotState& robot, std::string kind, std::string detail, std::string cause) {
  publish(robot, event_about(robot, std::move(kind), std::move(detail), std::move(cause)));
}

void SinkNotifier::note_part(const RobotState& robot, std::string kind, std::string detail, std::string cause,
                             const BootPart& part) {
  RobotEvent event = event_about(robot, std::move(kind), std::move(detail), std::move(cause));
  event.boot_id = part.boot_id;
  event.robot_time_us = part.from_robot_us;
  event.value = static_cast<float>(part.length_s);
  publish(robot, event);
}

}  // namespace server::station
