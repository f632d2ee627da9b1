// X.509 with OpenSSL.
#include "server/cli/data/certificate_maker.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <openssl/ec.h>
#include <openssl/pem.h>
#include <openssl/rand.h>

#include <array>
#include <stdexcept>

namespace server::cli {
namespace {

constexpr int kAuthorityDays = 3652;
constexpr long kHourBackSeconds = -3600;
constexpr long kDaySeconds = 24 * 60 * 60;
constexpr long kX509Version3 = 2;

void require(bool done, const char* what) {
  if (!done) throw std::runtime_error{fmt::format("cannot make {}: {}", what, base::openssl_error("no reason"))};
}

template <class Write>
std::string pem(Write write, const char* what) {
  const base::Openssl<BIO> memory{BIO_new(BIO_s_mem())};
  require(memory != nullptr && write(memory.get()) == 1, what);
  char* text = nullptr;
  const long size = BIO_get_mem_data(memory.get(), &text);
  return {text, static_cast<std::size_t>(size)};
}

void add_extension(X509& certificate, const X509& issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, const_cast<X509*>(&issuer), &certificate, nullptr, nullptr, 0);
  const base::Openssl<X509_EXTENSION> extension{X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str())};
  require(extension != nullptr && X509_add_ext(&certificate, extension.get(), -1) == 1, "an extension");
}

// Whose it is, when, and a serial number that nobody can guess.
base::Openssl<X509> begin(EVP_PKEY& key, const std::string& common_name, int days) {
  base::Openssl<X509> certificate{X509_new()};
  require(certificate != nullptr, "a certificate");
  std::array<unsigned char, 16> serial{};
  require(RAND_bytes(serial.data(), serial.size()) == 1, "a serial number");
  serial[0] = static_cast<unsigned char>((serial[0] & 0x3FU) | 0x40U);  // positive, and of 16 bytes
  const std::unique_ptr<BIGNUM, decltype(&BN_free)> number{BN_bin2bn(serial.data(), serial.size(), nullptr), BN_free};
  BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate.get()));
  X509_set_version(certificate.get(), kX509Version3);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), kHourBackSeconds);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), days * kDaySeconds);
  X509_set_pubkey(certificate.get(), &key);
  const auto* name = reinterpret_cast<const unsigned char*>(common_name.c_str());
  X509_NAME* subject = X509_get_subject_name(certificate.get());
  require(X509_NAME_add_entry_by_txt(subject, "O", MBSTRING_UTF8, reinterpret_cast<const unsigned char*>("Rheonaut"),
                                     -1, -1, 0) == 1 &&
              X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_UTF8, name, -1, -1, 0) == 1,
          "a name");
  return certificate;
}

void sign(X509& certificate, EVP_PKEY& key) { require(X509_sign(&certificate, &key, EVP_sha256()) > 0, "a signature"); }

}  // namespace

bool is_address(const std::string& name) {
  std::array<unsigned char, 16> bytes{};
  return inet_pton(AF_INET, name.c_str(), bytes.data()) == 1 || inet_pton(AF_INET6, name.c_str(), bytes.data()) == 1;
}

base::Openssl<EVP_PKEY> make_key() {
  base::Openssl<EVP_PKEY> key{EVP_EC_gen("P-256")};
  require(key != nullptr, "a key");
  return key;
}

std::string key_pem(EVP_PKEY& key) {
  const auto write = [&key](BIO* to) {
    return PEM_write_bio_PKCS8PrivateKey(to, &key, nullptr, nullptr, 0, nullptr, nullptr);
  };
  return pem(write, "the file of a key");
}

std::string certificate_pem(X509& certificate) {
  return pem([&certificate](BIO* to) { return PEM_write_bio_X509(to, &certificate); }, "the file of a certificate");
}

base::Openssl<X509> make_authority(EVP_PKEY& key) {
  std::array<unsigned char, 4> mark{};  // two labs' authorities must not look alike in a browser's list
  require(RAND_bytes(mark.data(), mark.size()) == 1, "a name");
  const std::string name = fmt::format("Rheonaut lab {:02x}{:02x}{:02x}{:02x}", mark[0], mark[1], mark[2], mark[3]);
  base::Openssl<X509> authority = begin(key, name, kAuthorityDays);
  X509_set_issuer_name(authority.get(), X509_get_subject_name(authority.get()));
  add_extension(*authority, *authority, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_extension(*authority, *authority, NID_key_usage, "critical,keyCertSign,cRLSign");
  add_extension(*authority, *authority, NID_subject_key_identifier, "hash");
  sign(*authority, key);
  return authority;
}

base::Openssl<X509> make_certificate(EVP_PKEY& key, const std::vector<std::string>& names, int days,
                                     const X509& authority, EVP_PKEY& authority_key) {
  base::Openssl<X509> certificate = begin(key, "station", days);
  X509_set_issuer_name(certificate.get(), X509_get_subject_name(&authority));
  std::string subject;
  for (const std::string& name : names) {
    subject += fmt::format("{}{}:{}", subject.empty() ? "" : ",", is_address(name) ? "IP" : "DNS", name);
  }
  add_extension(*certificate, authority, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(*certificate, authority, NID_key_usage, "critical,digitalSignature");
  add_extension(*certificate, authority, NID_ext_key_usage, "serverAuth");
  add_extension(*certificate, authority, NID_subject_key_identifier, "hash");
  add_extension(*certificate, authority, NID_authority_key_identifier, "keyid");
  add_extension(*certificate, authority, NID_subject_alt_name, subject);
  sign(*certificate, authority_key);
  return certificate;
}

}  // namespace server::cli
