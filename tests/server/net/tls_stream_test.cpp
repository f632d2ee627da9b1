// A stream over TLS: writes that do not wait, and reads that keep nothing back.
#include <optional>
#include <vector>

#include "tests/server/net/tls_fixture.hpp"

namespace server {
namespace {

// What an emergency stop rests on: the frame is on its way when write_now() returns, without a turn of the loop.
TEST_F(TlsTest, BytesLeaveAtOnce) {
  start();
  Client client{clock, listener.endpoint()};
  ASSERT_TRUE(client.shake_hands());
  ASSERT_EQ(outcome, tls::TlsHandshakes::Outcome::secure);
  const auto stream = make_stream(std::move(*served), sockets);
  EXPECT_EQ(stream->write_now(asio::buffer("stop", 4)), 4U);
  EXPECT_EQ(client.read(4), "stop");
}

class Received {
 public:
  explicit Received(net::ByteStream& stream) : stream_{stream} {
    stream_.on_readable([this] {
      const net::ByteStream::Read got = stream_.read_now(asio::buffer(buffer_));
      text.append(buffer_.data(), got.size);
      if (got.has_ended) {
        has_ended = true;
        stream_.on_readable(nullptr);
      }
    });
  }
  std::string text;
  bool has_ended = false;

 private:
  net::ByteStream& stream_;
  std::vector<char> buffer_ = std::vector<char>(net::ByteStream::kReadBytes);
};

// OpenSSL keeps nothing back of which the socket would not tell.
TEST_F(TlsTest, RecordsThatCameTogetherAreReadTogether) {
  start();
  Client client{clock, listener.endpoint()};
  ASSERT_TRUE(client.shake_hands());
  const auto stream = make_stream(std::move(*served), sockets);
  Received received{*stream};
  clock.settle();
  client.cork(1);
  for (const char* record : {"telemetry ", "and ", "the answer"}) client.send(record);
  client.cork(0);
  clock.settle();
  EXPECT_EQ(received.text, "telemetry and the answer");
}

TEST_F(TlsTest, WhatComesWithTheEndOfTheHandshakeIsRead) {
  start();
  Client client{clock, listener.endpoint()};
  ASSERT_TRUE(client.shake_hands("hello"));
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  const auto stream = make_stream(std::move(*served), sockets);
  Received received{*stream};
  clock.settle();
  EXPECT_EQ(received.text, "hello");
}

TEST_F(TlsTest, LargeRecordsAndTheEndBehindThemAreRead) {
  start();
  Client client{clock, listener.endpoint()};
  ASSERT_TRUE(client.shake_hands());
  const auto stream = make_stream(std::move(*served), sockets);
  Received received{*stream};
  std::string all;
  for (int i = 0; i < 10; ++i) {
    const std::string record(16'000, static_cast<char>('a' + i));
    client.send(record);
    all += record;
    if (i % 3 == 2) clock.run_for(10ms);
  }
  client.hang_up();
  clock.run_for(1s);
  EXPECT_EQ(received.text.size(), all.size());
  EXPECT_EQ(received.text, all);
  EXPECT_TRUE(received.has_ended);
}

// A peer that does not read: what does not fit waits, and nothing is lost, doubled or out of order.
TEST_F(TlsTest, WhatASocketDoesNotTakeIsWhatTheNextWriteBeginsWith) {
  start();
  Client client{clock, listener.endpoint(), 4096};
  ASSERT_TRUE(client.shake_hands());
  const auto stream = make_stream(std::move(*served), sockets);
  std::string sent;
  std::string rest;
  for (int frame = 0; rest.empty() && frame < 100'000; ++frame) {
    const std::string bytes = std::to_string(frame) + std::string(900, static_cast<char>('a' + frame % 26));
    const std::size_t taken = stream->write_now(asio::buffer(bytes));
    sent += bytes;
    rest = bytes.substr(taken);
  }
  ASSERT_FALSE(rest.empty()) << "the socket never filled";
  std::optional<bool> written;
  const auto write = [](net::ByteStream& to, std::string bytes, std::optional<bool>& done) -> asio::awaitable<void> {
    done = co_await to.write(asio::buffer(bytes));
  };
  tasks.spawn("write", write(*stream, rest, written));
  clock.settle();
  EXPECT_FALSE(written) << "it waits for room";
  EXPECT_EQ(client.read(sent.size()), sent);
  clock.settle();
  EXPECT_EQ(written, true);
  EXPECT_EQ(stream->write_now(asio::buffer("stop", 4)), 4U);
  EXPECT_EQ(client.read(4), "stop");
}

}  // namespace
}  // namespace server
