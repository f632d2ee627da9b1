// Which station a robot believes to be its own: by the pin of its key, or by the authority that signed its certificate.
//
// TLS 1.2 or 1.3, ephemeral keys and authenticated encryption only. Nothing is sent to a station that is not the right
// one. One trust serves any number of robots on one thread.
#pragma once

#include <openssl/ssl.h>

#include <memory>
#include <optional>
#include <string>

namespace sim_robot {

class StationTrust {
 public:
  // `pin`: SHA-256 of the station's public key (SubjectPublicKeyInfo), 64 hexadecimal digits, as `rheonaut certificate`
  // prints it. `authority`: a file of certificates in PEM; the station's must also name `host`. At least one of them.
  // Throws std::invalid_argument.
  StationTrust(const std::optional<std::string>& pin, const std::optional<std::string>& authority,
               const std::string& host);

  struct Free {
    void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
    // Its session may be resumed though it was cut; after a fault OpenSSL has forgotten it.
    void operator()(SSL* connection) const {
      SSL_set_shutdown(connection, SSL_SENT_SHUTDOWN | SSL_RECEIVED_SHUTDOWN);
      SSL_free(connection);
    }
    void operator()(SSL_SESSION* session) const { SSL_SESSION_free(session); }
  };
  using Connection = std::unique_ptr<SSL, Free>;
  using Session = std::unique_ptr<SSL_SESSION, Free>;

  // A client's connection that has not begun.
  Connection connection() const;
  // After its handshake: why it is not the station's; empty: it is.
  std::string objection(const SSL& connection) const;

 private:
  std::unique_ptr<SSL_CTX, Free> context_;
  std::string pin_;  // lower case; empty: none
};

}  // namespace sim_robot
