// Sets up OpenSSL as a client and compares keys.
#include "sim_robot/client/station_trust.hpp"

#include <openssl/err.h>
#include <openssl/pem.h>

#include <boost/asio/ip/address.hpp>
#include <cctype>
#include <filesystem>
#include <stdexcept>

#include "base/tls/public_key.hpp"
#include "base/whole_file.hpp"

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

// Each certificate of the file; by OpenSSL's own reader a device without end would be read without end.
void load_authorities(X509_STORE& store, const std::string& file) {
  constexpr std::size_t kMaxBytes = 4 << 20;  // what Debian believes has 220 kB
  const base::WholeFile whole = base::read_whole(std::filesystem::path{file}, kMaxBytes);
  if (!whole.problem.empty()) throw std::invalid_argument("--tls-ca: '" + file + "' " + whole.problem);
  const base::Openssl<BIO> in{BIO_new_mem_buf(whole.text.data(), static_cast<int>(whole.text.size()))};
  int found = 0;
  while (in) {
    const base::Openssl<X509> certificate{PEM_read_bio_X509_AUX(in.get(), nullptr, nullptr, nullptr)};
    if (!certificate) break;
    found += X509_STORE_add_cert(&store, certificate.get());
  }
  const bool is_whole = found == 0 || ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  ERR_clear_error();  // that no more came
  if (!is_whole) throw std::invalid_argument("--tls-ca: '" + file + "' holds a certificate that is damaged");
  if (found == 0) throw std::invalid_argument("--tls-ca: '" + file + "' holds no certificates in PEM");
}

void believe(SSL_CTX* context, const std::string& authority, const std::string& host) {
  load_authorities(*SSL_CTX_get_cert_store(context), authority);
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
    : context_(base::make_tls_context(TLS_client_method())), pin_(pin ? parse_pin(*pin) : "") {
  if (!pin && !authority) throw std::invalid_argument("TLS needs --tls-pin or --tls-ca");
  SSL_CTX_set_cipher_list(context_.get(), kCiphers12);
  SSL_CTX_set_session_cache_mode(context_.get(), SSL_SESS_CACHE_CLIENT | SSL_SESS_CACHE_NO_INTERNAL);
  if (authority) believe(context_.get(), *authority, host);
}

// SAFETY: a station with another key could give the robot any command. OpenSSL itself refuses a certificate that
// `authority` has not signed.
std::string StationTrust::objection(const SSL& connection) const {
  if (pin_.empty()) return "";
  const X509* certificate = SSL_get0_peer_certificate(&connection);
  const EVP_PKEY* key = certificate == nullptr ? nullptr : X509_get0_pubkey(certificate);
  const std::string found = key == nullptr ? "none" : base::pin_of(*key);
  return found == pin_ ? "" : "its key has the pin " + found;
}

}  // namespace sim_robot
