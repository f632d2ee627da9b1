// TLS of a port: handshakes with a time limit, certificates that come into force, warnings.
#include <gmock/gmock.h>

#include "tests/server/net/tls_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

TEST_F(TlsTest, AClientThatSaysNothingIsLetGoAfterTenSecondsAndHoldsNobodyUp) {
  start();
  Client silent{clock, listener.endpoint()};
  EXPECT_FALSE(outcome);
  const std::int64_t begun_us = clock.steady_us();
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 20s));
  EXPECT_EQ(*outcome, tls::TlsHandshakes::Outcome::failed);
  EXPECT_EQ(clock.steady_us() - begun_us, tls::kHandshakeTime.count());
  EXPECT_EQ(security->handshakes()->counters().failed, 1U);
  EXPECT_THAT(log.str(), HasSubstr("test port: no TLS with 127.0.0.1:"));
  EXPECT_THAT(log.str(), HasSubstr("not done within 10 s"));
}

TEST_F(TlsTest, WhoDoesNotSpeakTlsIsDistinguishedAndWhatItSentCanStillBeRead) {
  start();
  Client client{clock, listener.endpoint()};
  client.send_plain("GET / HTTP/1.1\r\n");
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  EXPECT_EQ(*outcome, tls::TlsHandshakes::Outcome::not_tls);
  char bytes[64];
  EXPECT_EQ(::recv(served->tcp().native_handle(), bytes, sizeof bytes, MSG_DONTWAIT), 16);
  Client garbage{clock, listener.endpoint()};
  garbage.send_plain(std::string(1, '\x16') + std::string(200, 'x'));
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  EXPECT_EQ(*outcome, tls::TlsHandshakes::Outcome::failed);
}

TEST_F(TlsTest, AtMostOneFailureASecondIsLogged) {
  start();
  for (int i = 0; i < 20; ++i) {
    Client client{clock, listener.endpoint()};
    client.send_plain("x");
    ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  }
  EXPECT_EQ(said("no TLS"), 1);
  clock.run_for(1s);
  Client client{clock, listener.endpoint()};
  client.send_plain("x");
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  EXPECT_EQ(said("no TLS"), 2);
  EXPECT_THAT(log.str(), HasSubstr("(and 19 before)"));
  EXPECT_EQ(security->handshakes()->counters().failed, 21U);
}

TEST_F(TlsTest, ANewCertificateIsInForceForNewConnectionsWithinTwoLooks) {
  start();
  const std::string first = security->handshakes()->context().certificate.pin;
  Client old_client{clock, listener.endpoint()};
  ASSERT_TRUE(old_client.shake_hands());
  EXPECT_EQ(old_client.pin(), first);
  auto stream = make_stream(std::move(*served), sockets);

  renew(true);
  clock.run_for(2 * net::kCertificateCheckInterval + 1ms);
  const std::string second = security->handshakes()->context().certificate.pin;
  EXPECT_NE(second, first);
  Client new_client{clock, listener.endpoint()};
  ASSERT_TRUE(new_client.shake_hands());
  EXPECT_EQ(new_client.pin(), second);
  stream->write_now(asio::buffer("still", 5));
  EXPECT_EQ(old_client.read(5), "still") << "connections keep what they have";
}

TEST_F(TlsTest, ABrokenNewFileIsSaidOnceAndTheOldOneStaysInForce) {
  start();
  const std::string first = security->handshakes()->context().certificate.pin;
  std::ofstream{config.tls_certificate()} << "nonsense";
  clock.run_for(60s);
  EXPECT_EQ(security->handshakes()->context().certificate.pin, first);
  EXPECT_THAT(log.str(), HasSubstr("holds no certificate in PEM"));
  EXPECT_EQ(said("the one before stays in force"), 1);
  Client client{clock, listener.endpoint()};
  EXPECT_TRUE(client.shake_hands());
  fs::remove(config.tls_key());
  clock.run_for(60s);
  EXPECT_EQ(said("the one before stays in force"), 2) << "a file that goes missing is said, too";
  EXPECT_EQ(security->handshakes()->context().certificate.pin, first);
}

TEST_F(TlsTest, AnExpiryIsWarnedOfThirtyDaysBeforeAndOnceADay) {
  start();
  EXPECT_FALSE(security->state()["certificate"]["expires_soon"].get<bool>());
  const std::int64_t not_after_us = security->handshakes()->context().certificate.not_after_us;
  clock.step_utc(microseconds{not_after_us - clock.utc_us()} - 29h * 24);
  clock.skip(24h);
  clock.run_for(3s);
  EXPECT_TRUE(security->state()["certificate"]["expires_soon"].get<bool>());
  EXPECT_EQ(said("expires in 2"), 1);
  clock.run_for(1min);
  EXPECT_EQ(said("expires in 2"), 1);
  clock.skip(24h);
  clock.run_for(3s);
  EXPECT_EQ(said("expires in 2"), 2);
  clock.step_utc(30h * 24);
  clock.skip(24h);
  clock.run_for(3s);
  EXPECT_EQ(said("has expired"), 1);
}

TEST_F(TlsTest, AKeyThatIsNotTheCertificatesIsRefusedByName) {
  const fs::path kept = config.data_dir / "other.key";
  fs::copy_file(config.tls_key(), kept);
  renew(true);
  config.tls.key = kept;
  config.tls.certificate = config.data_dir / "tls" / "station.crt";
  try {
    net::TransportSecurity broken{clock, config};
    FAIL() << "was accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("other.key"));
    EXPECT_THAT(error.what(), HasSubstr("is not that of the certificate"));
  }
}

TEST_F(TlsTest, PlainTcpBeyondThisMachineIsShoutedAtOnceAndEachHour) {
  config.tls.mode = config::TlsMode::automatic;
  config.tls.insecure = true;
  config.robots = "192.0.2.1:7070";
  net::TransportSecurity exposed{clock, config};
  EXPECT_EQ(exposed.robots().tls, nullptr);
  EXPECT_TRUE(exposed.state()["exposed"].get<bool>());
  const std::string shout = "INSECURE: robots.listen = 192.0.2.1:7070";
  EXPECT_EQ(said(shout), 1);
  tasks.spawn("security", exposed.run());
  clock.run_for(59min);
  EXPECT_EQ(said(shout), 1);
  clock.run_for(2min);
  EXPECT_EQ(said(shout), 2);
  tasks.stop();
  clock.settle();
}

TEST_F(TlsTest, WithoutACertificateTheSentenceSaysHowToMakeOne) {
  fs::remove_all(config.data_dir / "tls");
  try {
    net::TransportSecurity none{clock, config};
    FAIL() << "was accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("rheonaut certificate --data " + config.data_dir.string()));
  }
}

}  // namespace
}  // namespace server
