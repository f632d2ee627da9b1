// Which station a robot believes to be its own: by the pin of its key, or by the authority that signed its certificate.
//
// TLS 1.2 or 1.3, ephemeral keys and authenticated encryption only. Nothing is sent to a station that is not the right
// one. One trust serves any number of robots on one thread.
#pragma once

#include <optional>
#include <string>

#include "base/tls/openssl.hpp"

namespace sim_robot {

class StationTrust {
 public:
  // `pin`: SHA-256 of the station's public key (SubjectPublicKeyInfo), 64 hexadecimal digits, as `rheonaut certificate`
  // prints it. `authority`: a file of certificates in PEM; the station's must also name `host`. At least one of them.
  // Throws std::invalid_argument.
  StationTrust(const std::optional<std::string>& pin, const std::optional<std::string>& authority,
               const std::string& host);

  SSL_CTX& context() const { return *context_; }  // of the connections to the station
  // After its handshake: why it is not the station's; empty: it is.
  std::string objection(const SSL& connection) const;

 private:
  base::Openssl<SSL_CTX> context_;
  std::string pin_;  // lower case; empty: none
};

}  // namespace sim_robot
