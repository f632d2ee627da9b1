// Level-triggered: what was not read to the end is ready again at the next look, behind the others.
#include "server/net/poll_set.hpp"

#include <unistd.h>

#include <algorithm>
#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/system/system_error.hpp>
#include <cerrno>
#include <new>
#include <optional>
#include <utility>

namespace server {
namespace asio = boost::asio;
using boost::system::error_code;

PollSet::Lane::Lane() : epoll{::epoll_create1(EPOLL_CLOEXEC)} {
  if (epoll < 0) throw boost::system::system_error{errno, boost::system::system_category(), "epoll_create1"};
}

PollSet::Lane::~Lane() { ::close(epoll); }

PollSet::PollSet(asio::io_context& loop, Clock& clock) : loop_{loop}, clock_{clock} {}

PollSet::~PollSet() {
  for (Socket* socket : std::exchange(sockets_, {})) {
    socket->end_wait(asio::error::operation_aborted);
    socket->set_ = nullptr;
  }
}

// As long as it lasts the loop knows of the lane, and wakes for each of its sockets that becomes ready. Asio's own
// epoll is edge-triggered; what is ready when a wait begins ends it all the same, since the wait itself registers anew.
struct PollSet::Loan {
  Loan(asio::io_context& loop, const Lane& lane) : descriptor{loop} { descriptor.assign(lane.epoll, error); }
  ~Loan() {
    if (descriptor.is_open()) descriptor.release();
  }
  Loan(const Loan&) = delete;
  Loan& operator=(const Loan&) = delete;
  auto ready() { return descriptor.async_wait(asio::posix::descriptor_base::wait_read, asio::use_awaitable); }
  asio::posix::stream_descriptor descriptor;
  error_code error;  // for want of memory
};

// When a look has found more than one there will be more after the pause: nothing else needs to wake the loop then.
asio::awaitable<void> PollSet::run() {
  std::optional<Loan> loan;
  std::int64_t due_us = 0;
  for (;;) {
    if (clock_.steady_us() < due_us) {
      loan.reset();  // nobody is to be woken for what comes in the pause
      co_await clock_.sleep_until(due_us);
    }
    const std::int64_t looked_at_us = clock_.steady_us();
    const std::size_t found = co_await work_off(rest_);
    due_us = found > 0 ? looked_at_us + kPause.count() : 0;
    if (found > 1) continue;
    if (!loan) loan.emplace(loop_, rest_);
    if (loan->error) {
      loan.reset();
      co_await clock_.sleep_for(kPause);
    } else {
      co_await loan->ready();
    }
  }
}

asio::awaitable<void> PollSet::run_awaited() {
  Loan loan{loop_, awaited_};
  if (loan.error) throw boost::system::system_error{loan.error, "cannot watch robots"};
  for (;;) {
    co_await loan.ready();
    co_await work_off(awaited_);
  }
}

// Returns how many there were.
asio::awaitable<std::size_t> PollSet::work_off(Lane& lane) {
  for (std::size_t total = 0;;) {
    const std::size_t found = look(lane);
    total += found;
    if (found < kAtOnce) co_return total;
    co_await asio::post(loop_, asio::use_awaitable);
  }
}

// How many it found. Who is woken may destroy any socket.
std::size_t PollSet::look(Lane& lane) {
  const int found = ::epoll_wait(lane.epoll, lane.ready.data(), kAtOnce, 0);
  lane.ready_count = static_cast<std::size_t>(std::max(found, 0));
  for (std::size_t at = 0; at < lane.ready_count; ++at) {
    const epoll_event event = lane.ready[at];
    if (event.data.ptr != nullptr) static_cast<Socket*>(event.data.ptr)->on_ready(event.events);
  }
  return std::exchange(lane.ready_count, 0);
}

void PollSet::forget(const Socket& socket) {
  for (Lane* lane : {&rest_, &awaited_}) {
    for (epoll_event& event : lane->ready) {
      if (event.data.ptr == &socket) event.data.ptr = nullptr;
    }
  }
}

PollSet::Socket::Socket(PollSet& set, int descriptor) : loop_{set.loop_}, set_{&set}, descriptor_{descriptor} {
  set.sockets_.insert(this);
}

PollSet::Socket::~Socket() {
  reader_ = nullptr;
  update();
  if (set_ == nullptr) return;
  set_->forget(*this);
  set_->sockets_.erase(this);
}

void PollSet::Socket::watch(std::function<void()> on_readable) {
  reader_ = std::move(on_readable);
  if (!update()) throw std::bad_alloc{};
}

asio::awaitable<void> PollSet::Socket::writable() {
  auto begin = [this](auto on_end) {
    auto slot = asio::get_associated_cancellation_slot(on_end);
    if (slot.is_connected()) slot.assign([this](asio::cancellation_type) { end_wait(asio::error::operation_aborted); });
    writer_ = std::move(on_end);
    if (!update()) end_wait(asio::error::no_memory);
  };
  return asio::async_initiate<const asio::use_awaitable_t<>, void(error_code)>(std::move(begin), asio::use_awaitable);
}

void PollSet::Socket::set_awaited(bool awaited) {
  if (awaited == is_awaited_) return;
  is_awaited_ = awaited;
  update();  // if that fails, for want of memory, it is read where it was
}

void PollSet::Socket::end_wait(error_code error) {
  if (!writer_) return;
  auto end = [on_end = std::exchange(writer_, nullptr), error]() mutable { on_end(error); };
  asio::post(loop_, std::move(end));
  update();
}

void PollSet::Socket::on_ready(std::uint32_t events) {
  constexpr std::uint32_t kEnd = EPOLLERR | EPOLLHUP;
  if ((events & (EPOLLOUT | kEnd)) != 0) end_wait({});
  if (reader_ && (events & (EPOLLIN | kEnd)) != 0) reader_();
}

// Both epolls look for exactly what somebody waits for: whatever they tell of besides would be told again and again. A
// socket is read in one of them, since ready in both it would wake the loop twice; it leaves that one only when it is
// in the other, so that for want of memory it is read in the wrong one rather than in none.
bool PollSet::Socket::update() {
  if (set_ == nullptr) return !reader_ && !writer_;
  const std::uint32_t reading = reader_ ? EPOLLIN : 0, writing = writer_ ? EPOLLOUT : 0;
  if (is_awaited_) {
    const bool is_set = set_events(set_->awaited_, in_awaited_, reading | writing);
    return set_events(set_->rest_, in_rest_, is_set ? 0 : reading) && is_set;
  }
  const bool is_set = set_events(set_->rest_, in_rest_, reading);
  return set_events(set_->awaited_, in_awaited_, (is_set ? 0 : in_awaited_ & reading) | writing) && is_set;
}

bool PollSet::Socket::set_events(const Lane& lane, std::uint32_t& present, std::uint32_t wanted) {
  if (present == wanted) return true;
  epoll_event event{};
  event.events = wanted;
  event.data.ptr = this;
  const int operation = present == 0 ? EPOLL_CTL_ADD : wanted == 0 ? EPOLL_CTL_DEL : EPOLL_CTL_MOD;
  if (::epoll_ctl(lane.epoll, operation, descriptor_, &event) != 0) return false;
  present = wanted;
  return true;
}

}  // namespace server
