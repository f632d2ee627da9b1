// Nothing is written for nobody.
#include "server/live/foxglove/feed.hpp"

#include <algorithm>
#include <ranges>

#include "server/station/state/telemetry_message.hpp"

namespace server::live::foxglove {

void Feed::add(Session& session, const std::map<station::RobotId, station::RobotState>& robots) {
  sessions_.push_back(&session);
  for (const station::RobotState& robot : std::views::values(robots)) {
    if (robot.link == station::LinkState::connected) session.on_robot(robot);
  }
  for (const station::RobotState& robot : std::views::values(robots)) session.on_robot(robot);
}

void Feed::remove(Session& session) { std::erase(sessions_, &session); }

std::vector<Feed::Reader> Feed::readers_of(const station::RobotId& robot, Topic topic) const {
  std::vector<Reader> readers;
  for (Session* session : sessions_) {
    const auto subscription = session->subscription(robot, topic);
    if (subscription) readers.push_back({session, *subscription});
  }
  return readers;
}

void Feed::on_robot(const station::RobotState& robot) {
  for (Session* session : sessions_) session->on_robot(robot);
}

void Feed::on_samples(const station::RobotState&, const station::SampleBatch& batch) {
  if ((batch.context.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) != 0) return;
  const auto readers = readers_of(batch.robot_id, Topic::telemetry);
  if (readers.empty()) return;
  const station::TelemetryMessages messages{std::nullopt,
                                            batch.boot_id,
                                            batch.context,
                                            {batch.clock_uncertainty_us, batch.received_at_us, batch.received_at_us},
                                            station::ChosenFields{}.set()};
  for (std::size_t index = 0; index < batch.samples.size(); ++index) {
    const std::uint64_t robot_time_us = batch.first_robot_time_us + index * batch.context.period_us;
    const std::int64_t utc_us = static_cast<std::int64_t>(robot_time_us) + batch.utc_offset_us;
    std::string text;
    messages.append(text, {batch.first_seq + index, robot_time_us, utc_us}, batch.samples[index], std::nullopt);
    const SharedText body = shared(std::move(text));
    for (const Reader& reader : readers) {
      reader.session->queue().push_data(reader.subscription, nanoseconds(utc_us), body);
    }
  }
}

void Feed::on_event(const station::RobotState&, const station::RobotEvent& event) {
  const auto readers = readers_of(event.robot_id, Topic::event);
  if (readers.empty()) return;
  const SharedText body = shared(event_message(event));
  for (const Reader& reader : readers) {
    reader.session->queue().push_data(reader.subscription, nanoseconds(event.received_at_us), body);
  }
}

void Feed::on_command(const station::CommandRecord& record) {
  if (record.kind == "renew_lease") return;
  const auto readers = readers_of(record.robot_id, Topic::command);
  if (readers.empty()) return;
  const SharedText body = shared(command_message(record));
  for (const Reader& reader : readers) {
    reader.session->queue().push_data(reader.subscription, nanoseconds(record.submitted_at_us), body);
  }
}

bool Feed::watches(const station::RobotId& robot) const {
  return std::ranges::any_of(sessions_, [&robot](const Session* session) { return session->is_subscribed(robot); });
}

}  // namespace server::live::foxglove
