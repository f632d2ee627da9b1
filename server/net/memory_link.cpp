// The in-memory pair of streams.
#include <algorithm>
#include <boost/asio/post.hpp>
#include <deque>
#include <utility>

#include "server/net/byte_stream.hpp"
#include "server/runtime/clock.hpp"

namespace server::net {
namespace asio = boost::asio;

// One direction: a bounded queue of bytes, as a socket buffer is.
struct MemoryLink::Pipe : std::enable_shared_from_this<MemoryLink::Pipe> {
  Pipe(asio::io_context& of, std::size_t capacity) : loop{of}, capacity_bytes{capacity}, writable{of} {}

  bool fits(std::size_t size) const { return bytes.empty() || bytes.size() + size <= capacity_bytes; }

  void take(asio::const_buffer more) {
    const auto* first = static_cast<const std::uint8_t*>(more.data());
    bytes.insert(bytes.end(), first, first + more.size());
    call_reader();
  }

  void close() {
    closed = true;
    call_reader();
    writable.notify();
  }

  bool is_readable() const { return closed || (!bytes.empty() && !stalled); }

  // As long as there is something to read.
  void call_reader() {
    if (!on_readable || !is_readable() || std::exchange(is_calling, true)) return;
    auto call = [weak = weak_from_this()] {
      const auto pipe = weak.lock();
      if (pipe == nullptr) return;
      pipe->is_calling = false;
      const bool had_bytes = !pipe->bytes.empty();
      if (pipe->on_readable && pipe->is_readable()) std::function{pipe->on_readable}();
      if (had_bytes) pipe->call_reader();  // the rest, or the end behind them
    };
    asio::post(loop, std::move(call));
  }

  asio::io_context& loop;
  std::size_t capacity_bytes;
  std::deque<std::uint8_t> bytes;
  std::function<void()> on_readable;
  bool is_calling = false;
  runtime::Signal writable;
  bool closed = false;
  bool stalled = false;
  ReadPace pace = ReadPace::prompt;
};

class MemoryLink::End final : public ByteStream {
 public:
  End(std::shared_ptr<Pipe> in, std::shared_ptr<Pipe> out) : in_{std::move(in)}, out_{std::move(out)} {}
  ~End() override {
    in_->on_readable = nullptr;
    close();
  }

  Read read_now(asio::mutable_buffer into) override {
    if (in_->stalled || in_->bytes.empty()) return {0, in_->closed};
    const auto count = std::min(in_->bytes.size(), into.size());
    std::copy_n(in_->bytes.begin(), count, static_cast<std::uint8_t*>(into.data()));
    in_->bytes.erase(in_->bytes.begin(), in_->bytes.begin() + static_cast<std::ptrdiff_t>(count));
    in_->writable.notify();
    return {count, false};
  }

  void on_readable(std::function<void()> call) override {
    in_->on_readable = std::move(call);
    in_->call_reader();
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

  void set_pace(ReadPace pace) override { in_->pace = pace; }

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

ReadPace MemoryLink::second_pace() const { return there_->pace; }

void MemoryLink::call_second() { std::function{there_->on_readable}(); }

void MemoryLink::stall(bool stalled) {
  for (Pipe* pipe : {there_.get(), back_.get()}) {
    pipe->stalled = stalled;
    pipe->call_reader();
  }
}

}  // namespace server::net
