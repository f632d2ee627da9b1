// The pin of a key is what OpenSSL's own tool computes of it.
#include "base/tls/public_key.hpp"

#include <gtest/gtest.h>
#include <openssl/pem.h>

#include <stdexcept>

namespace base {
namespace {

constexpr char kKey[] =
    "-----BEGIN PUBLIC KEY-----\n"
    "MFkwEwYHKoZIzj0CAQYIKoZIzj0DAQcDQgAE33eoBEXYvVcJ1kPndxW/nYzqrGAZ\n"
    "Ib0k+JCEpWMiGducwqlfwJwAWtQf76QO03f/fyScvbVyYeFCk+4zTEf+SA==\n"
    "-----END PUBLIC KEY-----\n";

// openssl pkey -pubin -in key.pem -outform der | sha256sum
TEST(PublicKey, ThePinIsTheSha256OfItsDer) {
  const Openssl<BIO> memory{BIO_new_mem_buf(kKey, -1)};
  const Openssl<EVP_PKEY> key{PEM_read_bio_PUBKEY(memory.get(), nullptr, nullptr, nullptr)};
  ASSERT_NE(key, nullptr);
  EXPECT_EQ(pin_of(*key), "e62c766144155179cbc1d33a6d395f29ad8964507336cca3e30dbb53664c3fd2");
}

TEST(PublicKey, AnEmptyKeyHasNone) {
  const Openssl<EVP_PKEY> key{EVP_PKEY_new()};
  EXPECT_THROW(pin_of(*key), std::runtime_error);
}

}  // namespace
}  // namespace base
