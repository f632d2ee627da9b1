// Both ends of a socket pair in this process, plain and with TLS.
#include "base/tls/wire.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <new>
#include <string>
#include <string_view>

namespace base {
namespace {

using Wait = Wire::Wait;

constexpr int kMaxSteps = 100;  // of a handshake, which takes about four

Openssl<X509> sign_itself(EVP_PKEY& key) {
  Openssl<X509> certificate{X509_new()};
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), 0);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), 3600);
  X509_set_pubkey(certificate.get(), &key);
  X509_sign(certificate.get(), &key, EVP_sha256());
  return certificate;
}

Openssl<SSL_CTX> server_context() {
  const Openssl<EVP_PKEY> key{EVP_EC_gen("P-256")};
  Openssl<SSL_CTX> context = make_tls_context(TLS_server_method());
  SSL_CTX_use_certificate(context.get(), sign_itself(*key).get());
  SSL_CTX_use_PrivateKey(context.get(), key.get());
  return context;
}

class WirePair {
 public:
  WirePair() {
    std::signal(SIGPIPE, SIG_IGN);
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, descriptors_) != 0) throw std::bad_alloc{};
    client = Wire{descriptors_[0]};
    server = Wire{descriptors_[1]};
  }
  ~WirePair() {
    cut_client();
    ::close(descriptors_[1]);
  }
  WirePair(const WirePair&) = delete;
  WirePair& operator=(const WirePair&) = delete;

  void begin_tls() {
    client.begin_tls(*client_side);
    server.begin_tls(*server_side);
  }
  // Empty when both ends are done, else what the first of them that failed says.
  std::string shake_hands() {
    for (int step = 0; step < kMaxSteps; ++step) {
      const Wire::Handshake ours = client.shake_hands(), theirs = server.shake_hands();
      if (!ours.failure.empty() || !theirs.failure.empty()) return ours.failure + "|" + theirs.failure;
      if (ours.wait == Wait::none && theirs.wait == Wait::none) return "";
    }
    return "no end";
  }
  void secure() {
    begin_tls();
    ASSERT_EQ(shake_hands(), "");
    read_all(client);  // the tickets of TLS 1.3
  }
  // The client's descriptor is closed, without a word of TLS.
  void cut_client() {
    if (descriptors_[0] >= 0) ::close(descriptors_[0]);
    descriptors_[0] = -1;
  }
  void send_past_tls(std::string_view bytes) const {
    ASSERT_EQ(::send(descriptors_[0], bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
  }

  static std::string read_all(Wire& wire) {
    std::string all;
    char piece[4096];
    for (auto last = wire.read(piece, sizeof piece); last.size > 0; last = wire.read(piece, sizeof piece)) {
      all.append(piece, last.size);
    }
    return all;
  }

  Openssl<SSL_CTX> client_side = make_tls_context(TLS_client_method()), server_side = server_context();
  Wire client{-1}, server{-1};

 private:
  int descriptors_[2] = {-1, -1};
};

Wire::Attempt write(Wire& wire, std::string_view bytes) { return wire.write(bytes.data(), bytes.size()); }

Wire::Attempt read_byte(Wire& wire) {
  char byte = 0;
  return wire.read(&byte, 1);
}

// What holds with TLS and without.
class WireBothWays : public ::testing::TestWithParam<bool> {
 protected:
  WireBothWays() {
    if (GetParam()) pair.secure();
  }
  WirePair pair;
};

INSTANTIATE_TEST_SUITE_P(PlainAndTls, WireBothWays, ::testing::Bool(),
                         [](const auto& each) { return each.param ? "tls" : "plain"; });

TEST_P(WireBothWays, BytesArriveAsTheyWereWritten) {
  EXPECT_EQ(pair.client.is_secure(), GetParam());
  EXPECT_EQ(write(pair.client, "hello").size, 5U);
  EXPECT_EQ(WirePair::read_all(pair.server), "hello");
  EXPECT_EQ(write(pair.server, "welcome").size, 7U);
  EXPECT_EQ(WirePair::read_all(pair.client), "welcome");
}

TEST_P(WireBothWays, AReadOfNothingSaysWhatToWaitFor) {
  const Wire::Attempt nothing = read_byte(pair.server);
  EXPECT_EQ(nothing.wait, Wait::readable);
  EXPECT_EQ(nothing.size, 0U);
  EXPECT_FALSE(nothing.has_ended());
  EXPECT_EQ(pair.server.peek().wait, Wait::readable);
}

TEST_P(WireBothWays, AnAttemptWithoutBytesIsNoEnd) {
  EXPECT_EQ(write(pair.client, "").wait, Wait::none);
  EXPECT_FALSE(pair.client.read(nullptr, 0).has_ended());
}

TEST_P(WireBothWays, PeekLeavesTheByteToTheRead) {
  write(pair.client, "x");
  EXPECT_EQ(pair.server.peek().size, 1U);
  EXPECT_EQ(WirePair::read_all(pair.server), "x");
}

// A peer that does not read: nothing is lost, doubled or out of order.
TEST_P(WireBothWays, WhatAWriteDidNotTakeIsWhatTheNextBeginsWith) {
  std::string sent, received;
  Wait wait = Wait::none;
  std::string rest;
  for (int frame = 0; wait == Wait::none && frame < 100'000; ++frame) {
    rest = std::to_string(frame) + std::string(3000, static_cast<char>('a' + frame % 26));
    sent += rest;
    while (!rest.empty() && wait == Wait::none) {
      const Wire::Attempt last = write(pair.client, rest);
      ASSERT_FALSE(last.has_ended());
      wait = last.wait;
      rest.erase(0, last.size);
    }
  }
  ASSERT_EQ(wait, Wait::writable) << "the socket never filled";
  while (!rest.empty()) {
    received += WirePair::read_all(pair.server);
    rest = std::string{rest};  // from another address
    const Wire::Attempt last = write(pair.client, rest);
    ASSERT_FALSE(last.has_ended());
    rest.erase(0, last.size);
  }
  received += WirePair::read_all(pair.server);
  EXPECT_EQ(received.size(), sent.size());
  EXPECT_EQ(received, sent);
}

TEST_P(WireBothWays, ALargeWriteIsTakenInPart) {
  const std::string large(4'000'000, 'x');
  const Wire::Attempt taken = write(pair.client, large);
  EXPECT_GT(taken.size, 0U);
  EXPECT_LT(taken.size, large.size());
  EXPECT_FALSE(taken.has_ended());
  EXPECT_EQ(WirePair::read_all(pair.server).size(), taken.size);
}

TEST_P(WireBothWays, TheEndComesAfterWhatWasWritten) {
  write(pair.client, "last words");
  pair.client.end_sending();
  EXPECT_EQ(WirePair::read_all(pair.server), "last words");
  EXPECT_TRUE(read_byte(pair.server).is_end);
  EXPECT_TRUE(pair.server.peek().is_end);
  EXPECT_EQ(write(pair.server, "answer").size, 6U) << "the other direction is open";
  EXPECT_EQ(WirePair::read_all(pair.client), "answer");
}

TEST_P(WireBothWays, ACutConnectionIsAnEnd) {
  pair.cut_client();
  EXPECT_TRUE(read_byte(pair.server).is_end);
}

TEST_P(WireBothWays, AResetIsAnError) {
  write(pair.server, "never read");
  pair.cut_client();
  const Wire::Attempt lost = read_byte(pair.server);
  EXPECT_EQ(lost.error, ECONNRESET);
  EXPECT_FALSE(lost.is_end);
}

TEST_P(WireBothWays, AWriteToAClosedConnectionIsAnError) {
  pair.cut_client();
  EXPECT_EQ(write(pair.server, "too late").error, GetParam() ? ECONNRESET : EPIPE);
}

TEST(Wire, BytesThatOpensslTookFromTheSocketAreKnown) {
  WirePair pair;
  pair.secure();
  write(pair.client, "one record");
  EXPECT_FALSE(pair.server.has_buffered()) << "the socket has it";
  EXPECT_EQ(read_byte(pair.server).size, 1U);
  EXPECT_TRUE(pair.server.has_buffered());
  EXPECT_EQ(WirePair::read_all(pair.server), "ne record");
  EXPECT_FALSE(pair.server.has_buffered());
}

TEST(Wire, BytesThatAreNoTlsAreAnError) {
  WirePair pair;
  pair.secure();
  pair.send_past_tls("GET / HTTP/1.1\r\n\r\n");
  EXPECT_EQ(read_byte(pair.server).error, ECONNRESET);
  EXPECT_EQ(read_byte(pair.server).error, ECONNRESET) << "and stay one";
}

TEST(Wire, AHandshakeWaitsForThePeer) {
  WirePair pair;
  pair.begin_tls();
  EXPECT_EQ(pair.server.shake_hands().wait, Wait::readable);
  EXPECT_EQ(pair.client.shake_hands().wait, Wait::readable) << "its hello is sent";
  EXPECT_EQ(pair.shake_hands(), "");
  EXPECT_FALSE(pair.client.was_resumed());
}

TEST(Wire, AClientSaysWhatItHoldsAgainstTheCertificate) {
  WirePair pair;
  SSL_CTX_set_verify(pair.client_side.get(), SSL_VERIFY_PEER, nullptr);
  pair.begin_tls();
  EXPECT_THAT(pair.shake_hands(), ::testing::StartsWith("self-signed certificate|"));
}

TEST(Wire, AHandshakeThatFailsSaysWhyInOpensslsWords) {
  WirePair pair;
  SSL_CTX_set_cipher_list(pair.server_side.get(), "ECDHE-RSA-AES128-GCM-SHA256");  // its key is not of RSA
  SSL_CTX_set_max_proto_version(pair.server_side.get(), TLS1_2_VERSION);
  pair.begin_tls();
  EXPECT_EQ(pair.shake_hands(), "|no shared cipher");
}

TEST(Wire, AHandshakeWithAClosedPeerFails) {
  WirePair pair;
  pair.begin_tls();
  pair.cut_client();
  EXPECT_FALSE(pair.server.shake_hands().failure.empty());
}

TEST(Wire, TlsIsOfVersion12OrNewer) {
  WirePair pair;
  SSL_CTX_set_cipher_list(pair.client_side.get(), "ALL:@SECLEVEL=0");
  SSL_CTX_set_min_proto_version(pair.client_side.get(), TLS1_VERSION);
  SSL_CTX_set_max_proto_version(pair.client_side.get(), TLS1_1_VERSION);
  pair.begin_tls();
  EXPECT_EQ(pair.shake_hands(), "|unsupported protocol");
}

// Though the first connection was cut, as radio links are.
TEST(Wire, ASessionIsResumedAfterACut) {
  WirePair first, second;
  first.secure();
  const Openssl<SSL_SESSION> session{SSL_get1_session(first.client.tls())};
  first.cut_client();
  EXPECT_TRUE(read_byte(first.server).is_end);
  second.client_side.swap(first.client_side);
  second.server_side.swap(first.server_side);
  second.begin_tls();
  SSL_set_session(second.client.tls(), session.get());
  EXPECT_EQ(second.shake_hands(), "");
  EXPECT_TRUE(second.client.was_resumed());
  EXPECT_TRUE(second.server.was_resumed());
}

TEST(OpensslError, IsTakenFromTheQueue) {
  EXPECT_EQ(Openssl<BIO>(BIO_new_file("/none/such", "r")), nullptr);
  EXPECT_NE(openssl_error("none"), "none");
  EXPECT_EQ(openssl_error("none"), "none");
}

}  // namespace
}  // namespace base
