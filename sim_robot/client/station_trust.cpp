// Sets up OpenSSL as a client and compares keys.
#include "sim_robot/client/station_trust.hpp"

#include <openssl/evp.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <cctype>
#include <new>
#include <stdexcept>

namespace sim_robot {
namespace {

constexpr const char* kCiphers12 =
    "ECDHE-ECDSA-AES128-GCM-SHA256:ECDHE-ECDSA-CHACHA20-POLY1305:ECDHE-RSA-AES128-GCM-SHA256:"
    "ECDHE-RSA-CHACHA20-POLY1305";
constexpr std::size_t kPinDigits = 64;

std::string parse_pin(const std::string& text) {
  std::string pin;
  for (const char c : text) {
    if (c != ':') pin += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  const bool is_hex = pin.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (is_hex && pin.size() == kPinDigits) return pin;
  throw std::invalid_argument("--tls-pin: '" + text + "' is not a SHA-256 of 64 hexadecimal digits");
}

std::string pin_of(const X509& certificate) {
  unsigned char* der = nullptr;
  const int size = i2d_X509_PUBKEY(X509_get_X509_PUBKEY(&certificate), &der);
  if (size <= 0) return "";
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int digest_size = 0;
  EVP_Digest(der, static_cast<std::size_t>(size), digest.data(), &digest_size, EVP_sha256(), nullptr);
  OPENSSL_free(der);
  constexpr char kHex[] = "0123456789abcdef";
  std::string hex;
  for (unsigned int i = 0; i < digest_size; ++i) {
    hex += kHex[digest[i] / 16U];
    hex += kHex[digest[i] % 16U];
  }
  return hex;
}

void believe(SSL_CTX* context, const std::string& authority, const std::string& host) {
  if (SSL_CTX_load_verify_locations(context, authority.c_str(), nullptr) != 1) {
    throw std::invalid_argument("--tls-ca: '" + authority + "' holds no certificates in PEM");
  }
  SSL_CTX_set_verify(context, SSL_VERIFY_PEER, nullptr);
  X509_VERIFY_PARAM* expected = SSL_CTX_get0_param(context);
  boost::system::error_code no_address;
  boost::asio::ip::make_address(host, no_address);
  const int set = no_address ? X509_VERIFY_PARAM_set1_host(expected, host.c_str(), 0)
                             : X509_VERIFY_PARAM_set1_ip_asc(expected, host.c_str());
  if (set != 1) throw std::invalid_argument("--tls-ca: '" + host + "' is no name that a certificate can have");
}

}  // namespace

StationTrust::StationTrust(const std::optional<std::string>& pin, const std::optional<std::string>& authority,
                           const std::string& host)
    : context_(SSL_CTX_new(TLS_client_method())), pin_(pin ? parse_pin(*pin) : "") {
  if (!pin && !authority) throw std::invalid_argument("TLS needs --tls-pin or --tls-ca");
  if (!context_) throw std::bad_alloc{};
  SSL_CTX_set_min_proto_version(context_.get(), TLS1_2_VERSION);
  SSL_CTX_set_cipher_list(context_.get(), kCiphers12);
  SSL_CTX_set_mode(context_.get(),
                   SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_RELEASE_BUFFERS);
  // A cut connection is an end like any other, after which the session may be resumed: frames say how long they are.
  SSL_CTX_set_options(context_.get(), SSL_OP_IGNORE_UNEXPECTED_EOF);
  SSL_CTX_set_session_cache_mode(context_.get(), SSL_SESS_CACHE_CLIENT | SSL_SESS_CACHE_NO_INTERNAL);
  if (authority) believe(context_.get(), *authority, host);
}

StationTrust::Connection StationTrust::connection() const {
  Connection made{SSL_new(context_.get())};
  if (!made) throw std::bad_alloc{};
  SSL_set_connect_state(made.get());
  return made;
}

// SAFETY: a station with another key could give the robot any command. OpenSSL itself refuses a certificate that
// `authority` has not signed.
std::string StationTrust::objection(const SSL& connection) const {
  if (pin_.empty()) return "";
  const X509* certificate = SSL_get0_peer_certificate(&connection);
  const std::string found = certificate == nullptr ? "none" : pin_of(*certificate);
  return found == pin_ ? "" : "its key has the pin " + found;
}

}  // namespace sim_robot
