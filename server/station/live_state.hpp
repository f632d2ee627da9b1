// Updates a robot's live state from the messages of the robot: its hello, samples and events.
#pragma once

#include <cstdint>
#include <string>

#include "protocol/messages.hpp"
#include "server/config/envelope.hpp"
#include "server/station/robot_entry.hpp"
#include "server/station/state/checked.hpp"
#include "server/station/state/robot_archive.hpp"

namespace server::station {

// The robot has connected. What belongs to its boot begins anew when it is another one.
void begin_connection(RobotEntry& entry, const AdmissionRequest& hello, const protocol::Hello& details,
                      const Admission& admission, const std::string& peer, std::int64_t now_steady_us);

// Writes the samples of a frame into `batch`, with UTC by the robot's clock as it is estimated now.
void fill_batch(const RobotState& robot, Checked<protocol::Telemetry> checked, SampleBatch& batch);

// A batch that is newer than what was shown becomes the robot's state; `limits` are those of its fluid. True when
// another controller is in force.
bool show_samples(RobotEntry& entry, const SampleBatch& batch, const config::CommandLimits& limits);

RobotEvent event_of(const RobotState& robot, Checked<protocol::Event> checked);

}  // namespace server::station
