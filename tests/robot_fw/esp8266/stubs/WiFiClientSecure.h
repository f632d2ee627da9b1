// Stub of the TLS client: the class below the public one, whose flush() the robot replaces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

constexpr std::uint16_t BR_TLS_ECDHE_RSA_WITH_AES_128_GCM_SHA256 = 0xC02F;
constexpr std::uint16_t BR_TLS_ECDHE_ECDSA_WITH_AES_128_GCM_SHA256 = 0xC02B;
constexpr std::uint16_t BR_TLS_ECDHE_RSA_WITH_CHACHA20_POLY1305_SHA256 = 0xCCA8;
constexpr std::uint16_t BR_TLS_ECDHE_ECDSA_WITH_CHACHA20_POLY1305_SHA256 = 0xCCA9;

namespace BearSSL {

struct PublicKey {
  explicit PublicKey(const char* text) : pem(text) {}
  std::string pem;
};

class Session {};

class WiFiClientSecureCtx {
 public:
  virtual ~WiFiClientSecureCtx() = default;
  virtual int connect(const char* host, std::uint16_t port);
  virtual std::uint8_t connected();
  virtual int available();
  virtual int read(std::uint8_t* bytes, std::size_t size);
  virtual int availableForWrite();
  virtual std::size_t write(const std::uint8_t* bytes, std::size_t size);
  bool flush(unsigned int) { return true; }
  virtual void flush();
  virtual void stop();
  void setNoDelay(bool on);
  void setTimeout(unsigned long timeout_ms);
  void setKnownKey(const PublicKey* key);
  bool setCiphers(const std::uint16_t* ciphers, int count);
  void setBufferSizes(int receive, int send);
  void setSession(Session* session);
  int getMFLNStatus();
};

}  // namespace BearSSL
