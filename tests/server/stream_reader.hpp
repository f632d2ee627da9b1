// How a coroutine of a test reads a stream.
#pragma once

#include "server/net/byte_stream.hpp"
#include "server/runtime/clock.hpp"

namespace server {

// At least one byte, or 0 when the stream has ended. Nobody else reads it.
inline boost::asio::awaitable<std::size_t> read_some(boost::asio::io_context& loop, net::ByteStream& stream,
                                                     boost::asio::mutable_buffer into) {
  struct Watch {
    Watch(net::ByteStream& of, runtime::Signal& ready) : stream{of} {
      stream.on_readable([&ready] { ready.notify(); });
    }
    ~Watch() { stream.on_readable(nullptr); }
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;
    net::ByteStream& stream;
  };
  runtime::Signal ready{loop};
  const Watch watch{stream, ready};
  for (;;) {
    const net::ByteStream::Read got = stream.read_now(into);
    if (got.size > 0 || got.has_ended) co_return got.size;
    co_await ready.wait();
  }
}

}  // namespace server
