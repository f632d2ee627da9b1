// A TLS connection whose writes do not wait for the peer.
//
// The core's client flushes after each record, and its flush waits until TCP has the acknowledgement: one round trip,
// up to 300 ms, in every write. Here a flush hands the record to TCP when TCP takes all of it, and returns either way.
#pragma once

#include <WiFiClientSecure.h>

#include "protocol/bytes.hpp"

namespace robot_fw::esp8266 {

constexpr std::size_t kFragmentBytes = 512;  // of a record; the smallest that TLS can agree on
// Of a record, with the ciphers of station_link.cpp: header 5, nonce 8, tag 16.
constexpr std::size_t kRecordOverheadBytes = 29;

class TlsStream final : public BearSSL::WiFiClientSecureCtx {
 public:
  // The core's connect() does both under one time-out, which is too long for a station that is not there, or too short
  // for the arithmetic of a handshake.
  bool reach(const IPAddress& address, std::uint16_t port, std::uint32_t limit_ms) {
    setTimeout(limit_ms);
    return WiFiClient::connect(address, port) != 0;
  }
  bool shake_hands(const char* host, std::uint32_t limit_ms) {
    setTimeout(limit_ms);
    return _connectSSL(host);
  }

  // What TCP takes at once. The override in the class below is another thing: it runs TLS, waits for TCP meanwhile, and
  // returns the room in TLS's own buffer.
  std::size_t tcp_room() {
    const int room = WiFiClient::availableForWrite();
    return room > 0 ? static_cast<std::size_t>(room) : 0;
  }

  // One frame, for which TCP must have room, records' overhead included. False when TLS did not take it.
  bool send(protocol::Bytes frame) {
    unsealed_bytes_ = frame.size;
    return write(frame.first, frame.size) == frame.size;
  }

  // Hands on the record that TLS still holds, once TCP has room for it. True when TLS holds none.
  bool push() {
    // SAFETY: it runs TLS until that can take more, which waits for TCP only when the record does not fit.
    if (holds_record_ && tcp_room() >= record_bytes_) holds_record_ = WiFiClientSecureCtx::availableForWrite() <= 0;
    return !holds_record_;
  }

  using BearSSL::WiFiClientSecureCtx::flush;
  // The core calls it when it has sealed a record. Looking for input would send it too, but not while input waits.
  void flush() override {
    const std::size_t size = unsealed_bytes_ < kFragmentBytes ? unsealed_bytes_ : kFragmentBytes;
    unsealed_bytes_ -= size;
    record_bytes_ = size + kRecordOverheadBytes;
    holds_record_ = true;
    (void)push();
  }

 private:
  std::size_t unsealed_bytes_ = 0;  // of the frame, not in a record yet
  std::size_t record_bytes_ = 0;    // of the latest record
  bool holds_record_ = false;       // TLS does, or part of it
};

}  // namespace robot_fw::esp8266
