// `rheonaut certificate`: what it makes, what it never overwrites, and what a renewal keeps.
#include <gmock/gmock.h>

#include "server/tls/tls_certificate.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

class CertificateTest : public ToolTest {
 protected:
  fs::path file(const char* name) const { return folder_ / "lab" / "tls" / name; }
  tls::TlsCertificate certificate() const { return tls::describe(*tls::load_certificate(file("station.crt"))); }
};

TEST_F(CertificateTest, IsSignedByTheLabsAuthorityAndNamesThisMachineAndWhatWasGiven) {
  const Answer made = ask("certificate --data @lab --name lab-pc.local --name 192.0.2.7 --name 2001:db8::7");
  ASSERT_EQ(made.exit_code, 0) << made.error;
  for (const char* name : {"lab-pc.local", "192.0.2.7", "2001:db8::7", "localhost", "127.0.0.1", "::1"}) {
    EXPECT_THAT(certificate().names, Contains(name));
  }
  const auto leaf = tls::load_certificate(file("station.crt"));
  const auto authority = tls::load_certificate(file("lab-ca.crt"));
  EXPECT_EQ(X509_verify(leaf.get(), X509_get0_pubkey(authority.get())), 1);
  EXPECT_EQ(X509_check_ca(leaf.get()), 0);
  EXPECT_EQ(X509_check_ca(authority.get()), 1);
  EXPECT_THAT(made.text, HasSubstr("pin      " + certificate().pin + "\n"));
  EXPECT_THAT(made.text, HasSubstr(certificate().public_key_pem)) << "as secrets.hpp takes it";
  EXPECT_THAT(made.text, HasSubstr("import " + file("lab-ca.crt").string()));
}

TEST_F(CertificateTest, KeysAreForTheirOwnerOnly) {
  ask("certificate --data @lab");
  for (const char* name : {"lab-ca.key", "station.key"}) {
    EXPECT_EQ(fs::status(file(name)).permissions(), fs::perms::owner_read | fs::perms::owner_write) << name;
  }
  EXPECT_EQ(fs::status(folder_ / "lab" / "tls").permissions(), fs::perms::owner_all);
}

TEST_F(CertificateTest, NothingIsOverwrittenUnasked) {
  ask("certificate --data @lab");
  const std::string pin = certificate().pin;
  const Answer again = ask("certificate --data @lab");
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.error, HasSubstr("--renew"));
  EXPECT_EQ(certificate().pin, pin);
  EXPECT_EQ(ask("certificate --data @lab --new-key").exit_code, 1);
  EXPECT_EQ(certificate().pin, pin);
}

TEST_F(CertificateTest, ARenewalKeepsKeyNamesAndAuthorityByDefault) {
  ask("certificate --data @lab --name lab-pc.local --days 10");
  const tls::TlsCertificate first = certificate();
  const auto authority = tls::load_certificate(file("lab-ca.crt"));
  ASSERT_EQ(ask("certificate --data @lab --renew").exit_code, 0);
  EXPECT_EQ(certificate().pin, first.pin);
  EXPECT_THAT(certificate().names, ElementsAreArray(first.names));
  EXPECT_GT(certificate().not_after_us, first.not_after_us + std::int64_t{86'400'000'000} * 700);
  EXPECT_EQ(X509_cmp(authority.get(), tls::load_certificate(file("lab-ca.crt")).get()), 0)
      << "browsers have imported it";
  ASSERT_EQ(ask("certificate --data @lab --renew --new-key").exit_code, 0);
  EXPECT_NE(certificate().pin, first.pin);
}

TEST_F(CertificateTest, ANameThatIsNoneIsRefusedBeforeAnythingIsMade) {
  const Answer refused = ask("certificate --data @lab --name lab_pc,DNS:evil.example");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.error, HasSubstr("'lab_pc,DNS:evil.example'"));
  EXPECT_FALSE(fs::exists(folder_ / "lab"));
}

}  // namespace
}  // namespace server::cli
