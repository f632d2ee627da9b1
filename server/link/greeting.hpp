// The greeting of a robot: the check of its Hello, and the Welcome that answers it.
//
// Pure. Admission is decided elsewhere: Station::may_connect, RobotArchive::admit.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "protocol/messages.hpp"
#include "server/config/link_settings.hpp"
#include "server/station/state/robot_archive.hpp"

namespace server::link {

struct Refusal {
  protocol::RefusalReason reason = rheonaut_REFUSAL_REASON_NONE;
  std::string detail;  // for people
};

// The refusal of a Hello that is impossible, or of another version; none when it may be admitted: the archive does not
// judge its numbers again.
std::optional<Refusal> refusal_of(const protocol::Hello& hello, std::uint64_t robot_time_us);
// The refusal of a Hello that does not decode, since a text in it is longer than it may be.
Refusal refusal_of_too_long_hello();
// Whether the payload is a RobotFrame with a Hello in it, whatever that says.
bool has_hello(protocol::Bytes payload);
// The refusal of a robot that the archive does not admit.
std::optional<Refusal> refusal_of(const station::Admission& admission);

// What the archive is asked. `robot_time_us` is that of the Hello's frame, `received_at_us` UTC.
station::AdmissionRequest admission_request(const protocol::Hello& hello, std::uint64_t robot_time_us,
                                            bool from_loopback, std::int64_t received_at_us);

protocol::Welcome welcome_of(const station::Admission& admission, const config::LinkTimes& times, std::int64_t utc_us);
// Says no; the detail is cut to the room of the message.
protocol::Welcome welcome_of(const Refusal& refusal);

}  // namespace server::link
