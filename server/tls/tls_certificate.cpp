// Reads X.509 with OpenSSL.
#include "server/tls/tls_certificate.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <openssl/pem.h>

#include <ctime>
#include <stdexcept>

#include "base/tls/public_key.hpp"
#include "base/whole_file.hpp"
#include "server/runtime/private_file.hpp"

namespace server::tls {
namespace fs = std::filesystem;

namespace {

// A copy of the file in memory.
base::Openssl<BIO> open(const fs::path& file) {
  constexpr std::size_t kMaxBytes = 1 << 20;
  const base::WholeFile whole = base::read_whole(file, kMaxBytes);
  if (whole.error != 0) {
    throw std::runtime_error{fmt::format("cannot read '{}': {}", file.string(), runtime::denial(file, whole.error))};
  }
  if (!whole.problem.empty()) throw std::runtime_error{fmt::format("'{}' {}", file.string(), whole.problem)};
  base::Openssl<BIO> memory{BIO_new(BIO_s_mem())};
  if (!memory || BIO_write(memory.get(), whole.text.data(), static_cast<int>(whole.text.size())) < 0) {
    throw std::runtime_error{fmt::format("cannot read '{}': {}", file.string(), base::openssl_error("no reason"))};
  }
  return memory;
}

// A key behind a password would ask for it on the terminal, and the station would wait.
int no_password(char*, int, int, void*) { return 0; }

std::int64_t utc_us(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return 0;
  return std::int64_t{timegm(&parts)} * 1'000'000;
}

std::string text_of(const ASN1_STRING* string) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(string)),
          static_cast<std::size_t>(ASN1_STRING_length(string))};
}

std::string address_of(const ASN1_OCTET_STRING* bytes) {
  char text[INET6_ADDRSTRLEN] = "";
  const int family = ASN1_STRING_length(bytes) == 4 ? AF_INET : AF_INET6;
  if (family == AF_INET6 && ASN1_STRING_length(bytes) != 16) return "";
  inet_ntop(family, ASN1_STRING_get0_data(bytes), text, sizeof text);
  return text;
}

std::vector<std::string> names_of(const X509& certificate) {
  std::vector<std::string> names;
  const base::Openssl<GENERAL_NAMES> found{
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(&certificate, NID_subject_alt_name, nullptr, nullptr))};
  for (int i = 0; i < sk_GENERAL_NAME_num(found.get()); ++i) {
    const GENERAL_NAME* name = sk_GENERAL_NAME_value(found.get(), i);
    if (name->type == GEN_DNS) names.push_back(text_of(name->d.dNSName));
    if (name->type == GEN_IPADD) names.push_back(address_of(name->d.iPAddress));
  }
  return names;
}

}  // namespace

base::Openssl<X509> load_certificate(const fs::path& file) {
  base::Openssl<X509> certificate{PEM_read_bio_X509(open(file).get(), nullptr, no_password, nullptr)};
  if (certificate) return certificate;
  throw std::runtime_error{
      fmt::format("'{}' holds no certificate in PEM: {}", file.string(), base::openssl_error("unreadable"))};
}

base::Openssl<EVP_PKEY> load_key(const fs::path& file) {
  base::Openssl<EVP_PKEY> key{PEM_read_bio_PrivateKey(open(file).get(), nullptr, no_password, nullptr)};
  if (key) return key;
  throw std::runtime_error{fmt::format("'{}' holds no private key in PEM without a password: {}", file.string(),
                                       base::openssl_error("unreadable"))};
}

std::string public_key_pem(EVP_PKEY& key) {
  const base::Openssl<BIO> memory{BIO_new(BIO_s_mem())};
  PEM_write_bio_PUBKEY(memory.get(), &key);
  char* text = nullptr;
  const long size = BIO_get_mem_data(memory.get(), &text);
  return {text, static_cast<std::size_t>(size)};
}

TlsCertificate describe(X509& certificate) {
  TlsCertificate out;
  out.names = names_of(certificate);
  out.not_before_us = utc_us(X509_get0_notBefore(&certificate));
  out.not_after_us = utc_us(X509_get0_notAfter(&certificate));
  EVP_PKEY* key = X509_get0_pubkey(&certificate);
  if (key == nullptr) throw std::runtime_error{base::openssl_error("a certificate with a key of an unknown kind")};
  out.pin = base::pin_of(*key);
  out.public_key_pem = public_key_pem(*key);
  return out;
}

}  // namespace server::tls
