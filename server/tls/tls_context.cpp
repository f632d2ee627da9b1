// Sets up OpenSSL.
#include "server/tls/tls_context.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace server::tls {
namespace fs = std::filesystem;

namespace {

constexpr const char* kCiphers12 =
    "ECDHE-ECDSA-AES128-GCM-SHA256:ECDHE-ECDSA-CHACHA20-POLY1305:ECDHE-ECDSA-AES256-GCM-SHA384:"
    "ECDHE-RSA-AES128-GCM-SHA256:ECDHE-RSA-CHACHA20-POLY1305:ECDHE-RSA-AES256-GCM-SHA384";
constexpr const char* kCiphers13 = "TLS_AES_128_GCM_SHA256:TLS_CHACHA20_POLY1305_SHA256:TLS_AES_256_GCM_SHA384";
constexpr const char* kGroups = "X25519:P-256";
constexpr long kSessionSeconds = 2 * 60 * 60;
constexpr long kMaxSessions = 4096;  // kept for clients that take no tickets; the oldest goes

void require(long done, const char* what) {
  if (done == 1) return;
  throw std::runtime_error{fmt::format("TLS cannot be set up: {}: {}", what, base::openssl_error("no reason"))};
}

void set_up(SSL_CTX* context) {
  require(SSL_CTX_set_max_proto_version(context, TLS1_3_VERSION), "versions");
  require(SSL_CTX_set_cipher_list(context, kCiphers12), "ciphers of TLS 1.2");
  require(SSL_CTX_set_ciphersuites(context, kCiphers13), "ciphers of TLS 1.3");
  require(SSL_CTX_set1_groups_list(context, kGroups), "groups");
  // A client without hardware for AES puts ChaCha20 first and gets it.
  SSL_CTX_set_options(context, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE |
                                   SSL_OP_PRIORITIZE_CHACHA);
  constexpr unsigned char kSessionsOf[] = "rheonaut";
  require(SSL_CTX_set_session_id_context(context, kSessionsOf, sizeof kSessionsOf), "sessions");
  SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_SERVER);
  SSL_CTX_sess_set_cache_size(context, kMaxSessions);
  SSL_CTX_set_timeout(context, kSessionSeconds);
}

}  // namespace

std::shared_ptr<const TlsContext> load_tls_context(const fs::path& certificate, const fs::path& key) {
  const base::Openssl<X509> leaf = load_certificate(certificate);
  const base::Openssl<EVP_PKEY> secret = load_key(key);
  if (X509_check_private_key(leaf.get(), secret.get()) != 1) {
    base::openssl_error("");
    throw std::runtime_error{
        fmt::format("the key in '{}' is not that of the certificate in '{}'", key.string(), certificate.string())};
  }
  auto context = std::make_shared<TlsContext>();
  context->certificate = describe(*leaf);
  context->ssl = base::make_tls_context(TLS_server_method());
  set_up(context->ssl.get());
  if (SSL_CTX_use_certificate_chain_file(context->ssl.get(), certificate.c_str()) != 1 ||
      SSL_CTX_use_PrivateKey(context->ssl.get(), secret.get()) != 1) {
    throw std::runtime_error{
        fmt::format("'{}' cannot be used for TLS: {}", certificate.string(), base::openssl_error("no reason"))};
  }
  return context;
}

}  // namespace server::tls
