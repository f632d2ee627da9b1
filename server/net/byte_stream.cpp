// The stream over a socket, which belongs to a PollSet instead of to the loop.
#include "server/net/byte_stream.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <boost/system/system_error.hpp>

#include "server/net/poll_set.hpp"
#include "server/tls/stream_socket.hpp"

namespace server::net {
namespace {

namespace asio = boost::asio;

constexpr int kMaxUnsentBytes = 4096;
constexpr std::size_t kMaxRecordBytes = 16 * 1024;  // of TLS, RFC 8446, 5.1

class Descriptor {
 public:
  explicit Descriptor(int descriptor) : descriptor_{descriptor} {}
  ~Descriptor() { ::close(descriptor_); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

class SocketStream final : public ByteStream {
 public:
  SocketStream(PollSet& set, std::string peer, bool from_loopback, std::pair<int, base::Wire> released)
      : peer_{std::move(peer)},
        from_loopback_{from_loopback},
        descriptor_{released.first},
        wire_{std::move(released.second)},
        socket_{set, descriptor_.get()} {
    ::setsockopt(descriptor_.get(), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kMaxUnsentBytes, sizeof kMaxUnsentBytes);
  }

  // In TLS whole records, as long as a further one has room: so OpenSSL keeps none back, which no epoll would report.
  Read read_now(asio::mutable_buffer into) override {
    base::Wire::Attempt last = wire_.read(into.data(), into.size());
    Read read{last.size, last.has_ended()};
    while (wire_.is_secure() && last.size > 0 && into.size() - read.size >= kMaxRecordBytes) {
      const asio::mutable_buffer rest = into + read.size;
      last = wire_.read(rest.data(), rest.size());
      read.size += last.size;  // the next read reports an end
    }
    return read;
  }

  void on_readable(std::function<void()> call) override { socket_.watch(std::move(call)); }

  std::size_t write_now(asio::const_buffer bytes) override { return wire_.write(bytes.data(), bytes.size()).size; }

  asio::awaitable<bool> write(asio::const_buffer bytes) override {
    while (bytes.size() > 0) {
      const base::Wire::Attempt last = wire_.write(bytes.data(), bytes.size());
      if (last.has_ended()) co_return false;
      bytes += last.size;
      if (last.wait != base::Wire::Wait::none) co_await socket_.writable();
    }
    co_return true;
  }

  void set_pace(ReadPace pace) override { socket_.set_pace(pace); }

  void close() override { ::shutdown(descriptor_.get(), SHUT_RDWR); }

  std::string peer() const override { return peer_; }
  bool from_loopback() const override { return from_loopback_; }

 private:
  std::string peer_;
  bool from_loopback_;
  Descriptor descriptor_;
  base::Wire wire_;
  PollSet::Socket socket_;
};

}  // namespace

std::unique_ptr<ByteStream> make_stream(tls::StreamSocket socket, PollSet& set) {
  std::string peer = socket.peer();
  const bool from_loopback = socket.from_loopback();
  return std::make_unique<SocketStream>(set, std::move(peer), from_loopback, std::move(socket).release());
}

}  // namespace server::net
