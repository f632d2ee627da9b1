// A connection as a stream of bytes: TLS, TCP, or two ends in memory for tests in virtual time.
//
// Loop thread. One reader and one writer at a time. The owner keeps the stream until both have returned.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <cstdint>
#include <memory>
#include <string>

namespace server {

class StreamSocket;

class ByteStream {
 public:
  virtual ~ByteStream() = default;

  // At least one byte, or 0 when the stream has ended (closed by either side, reset, cancelled).
  virtual boost::asio::awaitable<std::size_t> read_some(boost::asio::mutable_buffer into) = 0;

  // How many of the bytes the stream took without waiting: 0 also when it has ended. What it did not take must be what
  // the next write begins with. Not while a write() is under way.
  virtual std::size_t write_now(boost::asio::const_buffer bytes) = 0;

  // All bytes; false when the stream ended before.
  virtual boost::asio::awaitable<bool> write(boost::asio::const_buffer bytes) = 0;

  // Ends both directions; pending reads and writes return.
  virtual void close() = 0;

  virtual std::string peer() const = 0;
  virtual bool from_loopback() const = 0;
};

// Takes over a connected socket, in TLS when its handshake is done. Sets TCP_NODELAY, and a small TCP_NOTSENT_LOWAT so
// that next to nothing waits in the kernel in front of an emergency stop.
std::unique_ptr<ByteStream> make_stream(StreamSocket socket);
std::unique_ptr<ByteStream> make_tcp_stream(boost::asio::ip::tcp::socket socket);  // plain

// Two connected streams in memory, and the faults of the link between them.
class MemoryLink {
 public:
  // A writer waits while more than `capacity_bytes` would lie unread in its direction.
  explicit MemoryLink(boost::asio::io_context& loop, std::size_t capacity_bytes = 64 * 1024);
  ~MemoryLink();

  // Each end once.
  std::unique_ptr<ByteStream> take_first();
  std::unique_ptr<ByteStream> take_second();

  void cut();                // both ends see the end of the stream
  void stall(bool stalled);  // half-open: bytes are accepted and not delivered until the stall ends

 private:
  struct Pipe;
  class End;
  std::shared_ptr<Pipe> there_, back_;
};

}  // namespace server
