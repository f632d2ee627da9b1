// Stub of the TLS client: TCP, and TLS over it: the class below the public one, whose flush() the robot replaces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "IPAddress.h"

constexpr std::uint16_t BR_TLS_ECDHE_RSA_WITH_AES_128_GCM_SHA256 = 0xC02F;
constexpr std::uint16_t BR_TLS_ECDHE_ECDSA_WITH_AES_128_GCM_SHA256 = 0xC02B;
constexpr std::uint16_t BR_TLS_ECDHE_RSA_WITH_CHACHA20_POLY1305_SHA256 = 0xCCA8;
constexpr std::uint16_t BR_TLS_ECDHE_ECDSA_WITH_CHACHA20_POLY1305_SHA256 = 0xCCA9;

class WiFiClient {
 public:
  virtual ~WiFiClient() = default;
  virtual int connect(IPAddress address, std::uint16_t port);  // TCP, within the time-out
  virtual int availableForWrite();  // TCP's room
  void setTimeout(unsigned long timeout_ms);

 protected:
  // What TCP took of so many bytes. Waits up to twice the time-out when it does not take all.
  std::size_t write_some(std::size_t size);
};

namespace BearSSL {

struct PublicKey {
  explicit PublicKey(const char* text) : pem(text) {}
  bool isEC() const { return pem.find("-----BEGIN PUBLIC KEY-----") == 0; }
  bool isRSA() const { return false; }
  std::string pem;
};

class Session {};

class WiFiClientSecureCtx : public WiFiClient {
 public:
  virtual std::uint8_t connected();
  virtual int available();
  virtual int read(std::uint8_t* bytes, std::size_t size);
  int availableForWrite() override;  // TLS's room, when TCP has taken its record
  virtual std::size_t write(const std::uint8_t* bytes, std::size_t size);
  bool flush(unsigned int) { return true; }
  virtual void flush();
  virtual void stop();
  void setNoDelay(bool on);
  void setKnownKey(const PublicKey* key);
  bool setCiphers(const std::uint16_t* ciphers, int count);
  void setBufferSizes(int receive, int send);
  void setSession(Session* session);
  int getMFLNStatus();

 protected:
  bool _connectSSL(const char* host);  // the handshake, within the time-out

 private:
  // Hands the sealed record to TCP, all of it when it may wait, else as much as TCP takes. True when none is left.
  bool run_engine(bool may_wait);
};

}  // namespace BearSSL
