// Checks a Hello and fills a Welcome.
#include "server/link/greeting.hpp"

#include <fmt/format.h>
#include <pb_decode.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "server/station/state/checked.hpp"

namespace server::link {
namespace {

// A text that is too long ends after a whole word, or at least after a whole character.
std::string within(const std::string& text, std::size_t most_bytes) {
  if (text.size() <= most_bytes) return text;
  constexpr std::string_view kGoesOn = " ...";
  std::size_t end = most_bytes - kGoesOn.size();
  if (const std::size_t space = text.rfind(' ', end); space != std::string::npos) {
    end = space;
  } else {
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
  }
  return text.substr(0, end).append(kGoesOn);
}

template <std::size_t size>
void copy_text(char (&to)[size], const std::string& from) {
  const std::string text = within(from, size - 1);
  std::memcpy(to, text.c_str(), text.size() + 1);
}

bool is_robot_id(const std::string& id) {
  constexpr auto kAllowed = "abcdefghijklmnopqrstuvwxyz0123456789_-";
  return !id.empty() && id.find_first_not_of(kAllowed) == std::string::npos;
}

}  // namespace

std::optional<Refusal> refusal_of(const protocol::Hello& hello, std::uint64_t robot_time_us) {
  if (hello.protocol_version != protocol::kProtocolVersion) {
    return Refusal{rheonaut_REFUSAL_REASON_VERSION, "this station speaks protocol version " +
                                                        std::to_string(protocol::kProtocolVersion) + ", the robot " +
                                                        std::to_string(hello.protocol_version)};
  }
  const bool samples_can_be = hello.oldest_seq <= hello.next_seq && hello.next_seq <= station::kMaxRobotNumber;
  const bool events_can_be =
      hello.oldest_event_seq <= hello.next_event_seq && hello.next_event_seq <= station::kMaxRobotNumber;
  if (!is_robot_id(hello.robot_id) || hello.boot_id == 0 || !samples_can_be || !events_can_be ||
      robot_time_us > station::kMaxRobotNumber) {
    return Refusal{rheonaut_REFUSAL_REASON_MALFORMED,
                   "robot_id must be 1 to 31 of [a-z0-9_-], boot_id not 0, and oldest_seq ≤ next_seq"};
  }
  // SAFETY: the limit of the time at power counts a schedule's ticks in this period; with 0 it would count nothing.
  if (hello.sample_period_us == 0 || hello.sample_period_us > station::kMaxPeriodUs) {
    return Refusal{rheonaut_REFUSAL_REASON_MALFORMED,
                   fmt::format("sample_period_us is {}; send the time from sample to sample in µs, 1 to {}",
                               hello.sample_period_us, station::kMaxPeriodUs)};
  }
  return std::nullopt;
}

Refusal refusal_of_too_long_hello() {
  return {rheonaut_REFUSAL_REASON_MALFORMED,
          "the hello does not decode: robot_id has at most 31 bytes, token 71, firmware_version 23"};
}

bool has_hello(protocol::Bytes payload) {
  pb_istream_t stream = pb_istream_from_buffer(payload.first, payload.size);
  for (;;) {
    pb_wire_type_t wire{};
    std::uint32_t tag = 0;
    bool is_at_end = false;
    if (!pb_decode_tag(&stream, &wire, &tag, &is_at_end)) return false;
    if (tag == rheonaut_RobotFrame_hello_tag) return wire == PB_WT_STRING;
    if (!pb_skip_field(&stream, wire)) return false;
  }
}

std::optional<Refusal> refusal_of(const station::Admission& admission) {
  if (admission.refusal == rheonaut_REFUSAL_REASON_NONE) return std::nullopt;
  return Refusal{admission.refusal, admission.detail};
}

station::AdmissionRequest admission_request(const protocol::Hello& hello, std::uint64_t robot_time_us,
                                            bool from_loopback, std::int64_t received_at_us) {
  station::AdmissionRequest request;
  request.robot_id = hello.robot_id;
  request.token = hello.token;
  request.from_loopback = from_loopback;
  request.boot_id = hello.boot_id;
  request.reset_cause = hello.reset_cause;
  request.firmware_version = hello.firmware_version;
  request.sample_period_us = hello.sample_period_us;
  request.robot_time_us = robot_time_us;
  request.oldest_seq = hello.oldest_seq;
  request.next_seq = hello.next_seq;
  request.oldest_event_seq = hello.oldest_event_seq;
  request.next_event_seq = hello.next_event_seq;
  request.acknowledged_next_seq = hello.acknowledged_next_seq;
  request.acknowledged_next_event_seq = hello.acknowledged_next_event_seq;
  request.received_at_us = received_at_us;
  return request;
}

protocol::Welcome welcome_of(const station::Admission& admission, const config::LinkTimes& times, std::int64_t utc_us) {
  protocol::Welcome welcome = rheonaut_Welcome_init_zero;
  welcome.protocol_version = protocol::kProtocolVersion;
  welcome.store_id = admission.store_id;
  welcome.durable_next_seq = admission.durable_next_seq;
  welcome.durable_next_event_seq = admission.durable_next_event_seq;
  welcome.link_timeout_ms = times.link_timeout_ms;
  welcome.heartbeat_interval_ms = times.heartbeat_interval_ms;
  welcome.samples_per_frame = times.samples_per_frame;
  welcome.utc_us = utc_us;
  return welcome;
}

protocol::Welcome welcome_of(const Refusal& refusal) {
  protocol::Welcome welcome = rheonaut_Welcome_init_zero;
  welcome.protocol_version = protocol::kProtocolVersion;
  welcome.refusal = refusal.reason;
  copy_text(welcome.detail, refusal.detail);
  return welcome;
}

}  // namespace server::link
