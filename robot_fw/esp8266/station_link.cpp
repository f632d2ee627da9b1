// Joins, dials, reads and writes.
#include "robot_fw/esp8266/station_link.hpp"

#include <ESP8266WiFi.h>

#include "protocol/frame.hpp"

namespace robot_fw::esp8266 {
namespace {

constexpr std::size_t kMaxRecordsPerFrame = 2;
// lwIP "v2 Lower Memory": 2 segments of 536 bytes, and 8 pieces in its queue, each record one.
constexpr std::size_t kSendBufferBytes = 1072;
constexpr std::uint32_t kMaxRecordsUnderWay = 6;
constexpr std::size_t kMaxFrameHere = protocol::kMaxPrefixBytes + rheonaut_RobotFrame_size;

static_assert(kMaxFrameHere <= kMaxRecordsPerFrame * kFragmentBytes, "a frame needs more records");
static_assert(kMaxFrameHere + kMaxRecordsPerFrame * kRecordOverheadBytes <= kSendBufferBytes,
              "the largest frame never fits the send buffer");

// With authentication built in (no CBC), forward secret; the ones without hardware help, faster first.
constexpr std::uint16_t kCiphers[] = {
    BR_TLS_ECDHE_ECDSA_WITH_CHACHA20_POLY1305_SHA256,
    BR_TLS_ECDHE_RSA_WITH_CHACHA20_POLY1305_SHA256,
    BR_TLS_ECDHE_ECDSA_WITH_AES_128_GCM_SHA256,
    BR_TLS_ECDHE_RSA_WITH_AES_128_GCM_SHA256,
};

constexpr std::uint64_t kJoinUs = 15'000'000;
constexpr std::uint32_t kShortestPauseMs = 100, kLongestPauseMs = 600, kMaxDoublings = 3;
constexpr std::uint32_t kAnswerMs = 2'000;     // from the name of the station to a connection
constexpr std::uint32_t kHandshakeMs = 8'000;  // 1 to 5 s of arithmetic
// SAFETY: should a call that is not to wait do so after all, it gives up before the motor's interrupt does. The core
// waits up to twice as long, and a turn of the loop may try three times: reading, pushing a record, looking for the
// peer.
constexpr unsigned kOpenTimeoutMs = 5;

}  // namespace

StationLink::StationLink(const Secrets& secrets, WideClock& clock)
    : secrets_(secrets),
      clock_(clock),
      station_key_(secrets.station_key_pem),
      key_is_sound_(station_key_.isEC() || station_key_.isRSA()) {}

void StationLink::begin() {
  WiFi.persistent(false);        // SAFETY: nothing of the network is ever written to flash
  WiFi.setAutoReconnect(false);  // SAFETY: joining again is ours to time
  WiFi.mode(WIFI_STA);
  WiFi.setSleepMode(WIFI_NONE_SLEEP);  // a sleeping radio receives a stop 0.1 s late
}

bool StationLink::step(bool at_rest, bool ring_has_room) {
  ring_has_room_ = ring_has_room;
  if (!key_is_sound_) return false;  // nobody could be trusted
  if (state_ != State::off && state_ != State::joining && WiFi.status() != WL_CONNECTED) {
    close();
    state_ = State::off;
  }
  if (state_ == State::joining) wait_for_wifi();
  // SAFETY: joining, closing and the handshake block for up to seconds, in which no tick controls the motor.
  if (!at_rest) return false;
  if (socket_is_stale_) {
    stream_.stop();
    socket_is_stale_ = false;
  }
  if (state_ == State::open || clock_.now_us() < next_attempt_at_us_) return false;
  if (state_ == State::off) join();
  return state_ == State::ready && dial();
}

void StationLink::join() {
  WiFi.begin(secrets_.wifi_name, secrets_.wifi_password);
  state_ = State::joining;
  join_until_us_ = clock_.now_us() + kJoinUs;
}

void StationLink::wait_for_wifi() {
  if (WiFi.status() == WL_CONNECTED) {
    state_ = State::ready;
  } else if (clock_.now_us() >= join_until_us_) {
    state_ = State::off;
    pause_after_failure();
  }
}

bool StationLink::dial() {
  if (!handshake()) {
    stream_.stop();
    pause_after_failure();
    return false;
  }
  stream_.setNoDelay(true);
  stream_.setTimeout(kOpenTimeoutMs);
  empty_buffer_ = 0;
  records_under_way_ = 0;
  state_ = State::open;
  return true;
}

bool StationLink::handshake() {
  stream_.setKnownKey(&station_key_);
  stream_.setCiphers(kCiphers, sizeof(kCiphers) / sizeof(kCiphers[0]));
  stream_.setBufferSizes(static_cast<int>(kFragmentBytes), static_cast<int>(kFragmentBytes));
  stream_.setSession(&session_);
  if (!reach_station() || !stream_.shake_hands(secrets_.station_host, kHandshakeMs)) return false;
  // SAFETY: a station that did not agree on short records would overflow the buffer with one, maybe that of a stop.
  return stream_.getMFLNStatus() != 0;
}

bool StationLink::reach_station() {
  const std::uint64_t began_us = clock_.now_us();
  IPAddress address;
  if (!WiFi.hostByName(secrets_.station_host, address, kAnswerMs)) return false;
  const std::uint64_t waited_ms = (clock_.now_us() - began_us) / 1000;
  return waited_ms < kAnswerMs &&
         stream_.reach(address, secrets_.station_port, kAnswerMs - static_cast<std::uint32_t>(waited_ms));
}

void StationLink::close() {
  if (state_ != State::open) return;
  state_ = State::ready;
  socket_is_stale_ = true;
  pause_after_failure();
}

void StationLink::pause_after_failure() {
  if (ring_has_room_) failures_ = 0;
  // Random, so that robots that lost one station do not come back at once.
  const std::uint32_t once_ms = kShortestPauseMs + ESP.random() % (kLongestPauseMs - kShortestPauseMs);
  next_attempt_at_us_ = clock_.now_us() + (once_ms << failures_) * 1000ULL;
  if (!ring_has_room_ && failures_ < kMaxDoublings) ++failures_;
}

bool StationLink::alive() { return state_ == State::open && stream_.connected() != 0; }

std::size_t StationLink::read(std::uint8_t* bytes, std::size_t capacity) {
  if (state_ != State::open || stream_.available() <= 0) return 0;
  const int count = stream_.read(bytes, capacity);
  return count > 0 ? static_cast<std::size_t>(count) : 0;
}

std::size_t StationLink::room() {
  if (state_ != State::open || !stream_.push()) return 0;
  const std::size_t free = stream_.tcp_room();
  if (free >= empty_buffer_) {
    empty_buffer_ = free;
    records_under_way_ = 0;
  }
  // SAFETY: TCP also runs out of places in its queue, and a write would wait for one.
  if (records_under_way_ + kMaxRecordsPerFrame > kMaxRecordsUnderWay) return 0;
  const std::size_t overhead = kMaxRecordsPerFrame * kRecordOverheadBytes;
  return free > overhead ? free - overhead : 0;
}

bool StationLink::write(protocol::Bytes frame) {
  records_under_way_ += static_cast<std::uint32_t>((frame.size + kFragmentBytes - 1) / kFragmentBytes);
  return stream_.send(frame);
}

std::int32_t StationLink::rssi_dbm() const { return state_ >= State::ready ? WiFi.RSSI() : 0; }

}  // namespace robot_fw::esp8266
