// The C++ face of the generated messages: short names, encode and decode, and the text of every enumerator.
//
// The structs are nanopb's own (robot.proto says what each field means); enumerators keep the spelling of robot.proto
// with the package in front, e.g. rheonaut_MODE_AUTO. text() gives the spelling of JSON and SQL, e.g. "auto".
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/bytes.hpp"
#include "robot.pb.h"

namespace protocol {

constexpr std::uint32_t kProtocolVersion = 1;
constexpr std::size_t kMaxFrameBytes = 1024;     // payload, without the length prefix
constexpr std::size_t kMaxSamplesPerFrame = 25;  // as in robot.options
constexpr std::uint32_t kDefaultLinkTimeoutMs = 1000;
constexpr std::uint32_t kDefaultHeartbeatIntervalMs = 200;
constexpr std::uint32_t kLeaseMs = 500;  // a manual duty lives this long unless renewed
constexpr std::uint64_t kMaxTimeToLiveUs = 10'000'000;

static_assert(rheonaut_RobotFrame_size <= kMaxFrameBytes, "a robot frame may exceed the frame limit");
static_assert(rheonaut_StationFrame_size <= kMaxFrameBytes, "a station frame may exceed the frame limit");

using RobotFrame = rheonaut_RobotFrame;
using StationFrame = rheonaut_StationFrame;
using Hello = rheonaut_Hello;
using Heartbeat = rheonaut_Heartbeat;
using Telemetry = rheonaut_Telemetry;
using Event = rheonaut_Event;
using Status = rheonaut_Status;
using CommandAck = rheonaut_CommandAck;
using StopProbeAnswer = rheonaut_StopProbeAnswer;
using Welcome = rheonaut_Welcome;
using StationHeartbeat = rheonaut_StationHeartbeat;
using StopProbe = rheonaut_StopProbe;
using Command = rheonaut_Command;
using Controller = rheonaut_Controller;
using ParameterPage = rheonaut_ParameterPage;

using Mode = rheonaut_Mode;
using SubState = rheonaut_SubState;
using ResetCause = rheonaut_ResetCause;
using EmergencyCause = rheonaut_EmergencyCause;
using EventKind = rheonaut_EventKind;
using EventCause = rheonaut_EventCause;
using CommandResult = rheonaut_CommandResult;
using RejectReason = rheonaut_RejectReason;
using RefusalReason = rheonaut_RefusalReason;

// Encodes into `out`; returns the number of bytes, or 0 when the message does not fit (or a string is not terminated).
std::size_t encode(const RobotFrame& frame, std::uint8_t* out, std::size_t capacity);
std::size_t encode(const StationFrame& frame, std::uint8_t* out, std::size_t capacity);
std::size_t encode(const Command& command, std::uint8_t* out, std::size_t capacity);  // as it lies in its frame

// Decodes one payload. Empty when the bytes are not such a message, carry no body, break a fixed size, or (telemetry)
// the columns differ in length or are empty. Values are not judged: a float may be NaN, an enumerator unknown.
std::optional<RobotFrame> decode_robot_frame(Bytes payload);
bool decode_robot_frame(Bytes payload, RobotFrame& into);  // false: `into` holds anything
std::optional<StationFrame> decode_station_frame(Bytes payload);
std::optional<Command> decode_command(Bytes payload);

// The JSON and SQL text of an enumerator; "unknown" for a value this version does not know.
const char* text(Mode value);
const char* text(SubState value);
const char* text(ResetCause value);
const char* text(EmergencyCause value);
const char* text(EventKind value);
const char* text(EventCause value);
const char* text(CommandResult value);
const char* text(RejectReason value);
const char* text(RefusalReason value);

// The name of the action that a command carries, e.g. "set_setpoint"; "unknown" for none.
const char* kind(const Command& command);

}  // namespace protocol
