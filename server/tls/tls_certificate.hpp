// The contents of a TLS certificate: names, expiry, and the key that clients may pin.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/tls/openssl.hpp"

namespace server::tls {

struct TlsCertificate {
  std::vector<std::string> names;  // of the subjectAltName: DNS names and IP addresses
  std::int64_t not_before_us = 0;  // UTC
  std::int64_t not_after_us = 0;   // UTC
  std::string pin;                 // SHA-256 of the SubjectPublicKeyInfo in DER, 64 hexadecimal digits
  std::string public_key_pem;      // what the firmware pins
};

// The first certificate in a PEM file, or the key. Throw std::runtime_error that names the file.
base::Openssl<X509> load_certificate(const std::filesystem::path& file);
base::Openssl<EVP_PKEY> load_key(const std::filesystem::path& file);

TlsCertificate describe(X509& certificate);
std::string public_key_pem(EVP_PKEY& key);

}  // namespace server::tls
