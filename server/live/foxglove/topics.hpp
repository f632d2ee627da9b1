// The topics of a robot, their schemas, and what happens as messages in JSON.
//
//   /telemetry  rheonaut.Telemetry  a message per sample (telemetry_message.hpp)
//   /event      rheonaut.Event      the columns of the view robot_event that the station knows before the database does
//   /command    rheonaut.Command    the columns of the view robot_command, at each change of a command's state
//
// Topics, schema names, members and values are those of an MCAP file of a run (export/mcap/mcap_writer.hpp), so that a
// layout made for one shows the other; an event has no event_row here. tests/system/foxglove_test.py compares both.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "server/station/state/station_state.hpp"

namespace server::live::foxglove {

enum class Topic : std::uint8_t { telemetry, event, command };
inline constexpr std::array kTopics{Topic::telemetry, Topic::event, Topic::command};

const char* name_of(Topic topic);         // "/telemetry"
const char* schema_name_of(Topic topic);  // "rheonaut.Telemetry"
const std::string& schema_of(Topic topic);

std::string event_message(const station::RobotEvent& event);
std::string command_message(const station::CommandRecord& command);

// Before 1970 there is no time.
constexpr std::uint64_t nanoseconds(std::int64_t time_us) {
  return time_us < 0 ? 0 : static_cast<std::uint64_t>(time_us) * 1000;
}

}  // namespace server::live::foxglove
