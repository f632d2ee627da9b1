// Makes keys on the curve P-256 and signs certificates with them.
#pragma once

#include <string>
#include <vector>

#include "base/tls/openssl.hpp"

namespace server::cli {

bool is_address(const std::string& name);  // of IP, version 4 or 6

// Throw std::runtime_error when OpenSSL cannot.
base::Openssl<EVP_PKEY> make_key();
std::string key_pem(EVP_PKEY& key);
std::string certificate_pem(X509& certificate);

// An authority that signs itself, for ten years; it may sign stations and nothing that signs again.
base::Openssl<X509> make_authority(EVP_PKEY& key);

// For a server with these names and addresses, from an hour ago (clocks differ) until `days` from now.
base::Openssl<X509> make_certificate(EVP_PKEY& key, const std::vector<std::string>& names, int days,
                                     const X509& authority, EVP_PKEY& authority_key);

}  // namespace server::cli
