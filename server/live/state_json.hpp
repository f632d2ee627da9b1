// The station's values as JSON, spelled as openapi.yaml says.
//
// 64-bit ids become strings, ids of 0 and times of 0 become null, a number that is not finite becomes null.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "base/json_text.hpp"
#include "server/station/state/station_state.hpp"

namespace server::live {

using base::decimal;
using base::dump;

nlohmann::json to_json(const station::RobotModel& model);
nlohmann::json to_json(const station::StopPath& path);
nlohmann::json to_json(const station::RobotState& robot);
nlohmann::json to_json(const station::Sample& sample);
nlohmann::json to_json(const station::CommandRecord& record);
nlohmann::json to_json(const station::ControlState& control);
nlohmann::json to_json(const station::Reservation& reservation);
nlohmann::json to_json(const station::ChangedLimit& limit);
nlohmann::json to_json(const station::RobotEvent& event);

// The message `samples` of /live as text. Its columns are written without a JSON tree, since it is made often.
std::string samples_message(const station::SampleBatch& batch);

// null for 0.
nlohmann::json id_text(std::uint64_t id);
nlohmann::json time_or_null(std::int64_t time_us);

}  // namespace server::live
