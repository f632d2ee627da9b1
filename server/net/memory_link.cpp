// The in-memory pair of streams.
#include <algorithm>
#include <deque>

#include "server/clock.hpp"
#include "server/net/byte_stream.hpp"

namespace server {
namespace asio = boost::asio;

// One direction: a bounded queue of bytes, as a socket buffer is.
struct MemoryLink::Pipe {
  Pipe(asio::io_context& loop, std::size_t capacity) : capacity_bytes{capacity}, readable{loop}, writable{loop} {}

  bool fits(std::size_t size) const { return bytes.empty() || bytes.size() + size <= capacity_bytes; }

  void take(asio::const_buffer more) {
    const auto* first = static_cast<const std::uint8_t*>(more.data());
    bytes.insert(bytes.end(), first, first + more.size());
    if (!stalled) readable.notify();
  }

  void close() {
    closed = true;
    readable.notify();
    writable.notify();
  }

  std::size_t capacity_bytes;
  std::deque<std::uint8_t> bytes;
  Signal readable, writable;
  bool closed = false;
  bool stalled = false;
};

class MemoryLink::End final : public ByteStream {
 public:
  End(std::shared_ptr<Pipe> in, std::shared_ptr<Pipe> out) : in_{std::move(in)}, out_{std::move(out)} {}
  ~End() override { close(); }

  asio::awaitable<std::size_t> read_some(asio::mutable_buffer into) override {
    const auto in = in_;
    while ((in->bytes.empty() || in->stalled) && !in->closed) co_await in->readable.wait();
    if (in->stalled || in->bytes.empty()) co_return 0;
    const auto count = std::min(in->bytes.size(), into.size());
    std::copy_n(in->bytes.begin(), count, static_cast<std::uint8_t*>(into.data()));
    in->bytes.erase(in->bytes.begin(), in->bytes.begin() + static_cast<std::ptrdiff_t>(count));
    in->writable.notify();
    co_return count;
  }

  std::size_t write_now(asio::const_buffer bytes) override {
    if (out_->closed || !out_->fits(bytes.size())) return 0;
    out_->take(bytes);
    return bytes.size();
  }

  asio::awaitable<bool> write(asio::const_buffer bytes) override {
    const auto out = out_;
    while (!out->fits(bytes.size()) && !out->closed) co_await out->writable.wait();
    if (out->closed) co_return false;
    out->take(bytes);
    co_return true;
  }

  void close() override {
    in_->close();
    out_->close();
  }

  std::string peer() const override { return "memory"; }
  bool from_loopback() const override { return true; }

 private:
  std::shared_ptr<Pipe> in_, out_;
};

MemoryLink::MemoryLink(asio::io_context& loop, std::size_t capacity_bytes)
    : there_{std::make_shared<Pipe>(loop, capacity_bytes)}, back_{std::make_shared<Pipe>(loop, capacity_bytes)} {}

MemoryLink::~MemoryLink() { cut(); }

std::unique_ptr<ByteStream> MemoryLink::take_first() { return std::make_unique<End>(back_, there_); }
std::unique_ptr<ByteStream> MemoryLink::take_second() { return std::make_unique<End>(there_, back_); }

void MemoryLink::cut() {
  there_->close();
  back_->close();
}

void MemoryLink::stall(bool stalled) {
  for (Pipe* pipe : {there_.get(), back_.get()}) {
    pipe->stalled = stalled;
    if (!stalled) pipe->readable.notify();
  }
}

}  // namespace server
