// A connection as a stream of bytes: TLS, TCP, or two ends in memory for tests in virtual time.
//
// Loop thread. One writer at a time, and the owner keeps the stream until it has returned.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "server/net/read_pace.hpp"

namespace server::tls {
class StreamSocket;
}  // namespace server::tls

namespace server::net {

class PollSet;

class ByteStream {
 public:
  virtual ~ByteStream() = default;

  // What is there, without waiting. Neither: nothing now. The buffer is of kReadBytes or more.
  static constexpr std::size_t kReadBytes = 32 * 1024;
  struct Read {
    std::size_t size = 0;
    bool has_ended = false;  // closed by either side, or reset
  };
  virtual Read read_now(boost::asio::mutable_buffer into) = 0;

  // Called from the loop, again and again, while there is something to read or the stream has ended, and now and then
  // without anything to read, until it is set to another function or to none. It does not throw, nor destroy the
  // stream.
  virtual void on_readable(std::function<void()> call) = 0;

  // How many of the bytes the stream took without waiting: 0 also when it has ended. What it did not take must be what
  // the next write begins with. Not while a write() is under way.
  virtual std::size_t write_now(boost::asio::const_buffer bytes) = 0;

  // All bytes; false when the stream ended before.
  virtual boost::asio::awaitable<bool> write(boost::asio::const_buffer bytes) = 0;

  // How soon what comes from now on, and what is unread, is read; prompt until it is set.
  virtual void set_pace(ReadPace pace) = 0;

  // Ends both directions; a pending write returns.
  virtual void close() = 0;

  virtual std::string peer() const = 0;
  virtual bool from_loopback() const = 0;
};

// Takes over a connected socket, in TLS when its handshake is done; it is read and written when the set says so. Sets a
// small TCP_NOTSENT_LOWAT so that next to nothing waits in the kernel in front of an emergency stop.
std::unique_ptr<ByteStream> make_stream(tls::StreamSocket socket, PollSet& set);

// Two connected streams in memory, and the faults of the link between them.
class MemoryLink {
 public:
  // A writer waits while more than `capacity_bytes` would lie unread in its direction.
  explicit MemoryLink(boost::asio::io_context& loop, std::size_t capacity_bytes = 64 * 1024);
  ~MemoryLink();

  // Each end once.
  std::unique_ptr<ByteStream> take_first();
  std::unique_ptr<ByteStream> take_second();

  void cut();                    // both ends see the end of the stream
  ReadPace second_pace() const;  // as its owner said last; here everything is read at once
  void call_second();            // as a set of sockets calls the owner of a quiet one, also when nothing has come
  void stall(bool stalled);      // half-open: bytes are accepted and not delivered until the stall ends

 private:
  struct Pipe;
  class End;
  std::shared_ptr<Pipe> there_, back_;
};

}  // namespace server::net
