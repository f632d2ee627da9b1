// A TLS connection whose writes do not wait for the peer.
//
// The core's client flushes after each record, and its flush waits until TCP has the acknowledgement: one round trip,
// up to 300 ms, in every write. Here a flush hands the record to TCP as far as it fits and returns.
#pragma once

#include <WiFiClientSecure.h>

namespace robot_fw::esp8266 {

class TlsStream final : public BearSSL::WiFiClientSecureCtx {
 public:
  using BearSSL::WiFiClientSecureCtx::flush;
  void flush() override { (void)available(); }  // SAFETY: looking for input also sends what is ready, without waiting
};

}  // namespace robot_fw::esp8266
