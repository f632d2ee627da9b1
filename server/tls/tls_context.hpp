// The station's side of TLS: versions, ciphers, certificate and key, as one OpenSSL context.
//
// TLS 1.2 and 1.3; ephemeral keys and authenticated encryption only; no renegotiation, no compression, no early data.
// Sessions are resumed, by ticket or (the ESP8266) by number, within two hours and as long as the context is in use.
#pragma once

#include <filesystem>
#include <memory>

#include "base/tls/openssl.hpp"
#include "server/tls/tls_certificate.hpp"

namespace server::tls {

struct TlsContext {
  base::Openssl<SSL_CTX> ssl;
  TlsCertificate certificate;
};

// Reads the chain and the key, which must belong together. May take milliseconds. Throws std::runtime_error that names
// the file and says what is wrong with it.
std::shared_ptr<const TlsContext> load_tls_context(const std::filesystem::path& certificate,
                                                   const std::filesystem::path& key);

}  // namespace server::tls
