// Level-triggered: what was not read to the end is ready again in the next round, behind the others.
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
#include <utility>

namespace server::net {
namespace asio = boost::asio;
using boost::system::error_code;

PollSet::Group::Group() : epoll{::epoll_create1(EPOLL_CLOEXEC)} {
  if (epoll < 0) throw boost::system::system_error{errno, boost::system::system_category(), "epoll_create1"};
}

PollSet::Group::~Group() { ::close(epoll); }

PollSet::PollSet(asio::io_context& loop, runtime::Clock& clock) : loop_{loop}, clock_{clock}, has_quiet_{loop} {}

PollSet::~PollSet() {
  for (Socket* socket : std::exchange(sockets_, {})) {
    socket->end_wait(asio::error::operation_aborted);
    socket->set_ = nullptr;
  }
}

// While it lasts the group's epoll is registered with the loop, which wakes for each socket that becomes ready. Asio's
// own epoll is edge-triggered; what is ready when a wait begins ends it all the same, since the wait itself registers
// anew.
struct PollSet::Registration {
  Registration(asio::io_context& loop, const Group& group) : descriptor{loop} { descriptor.assign(group.epoll, error); }
  ~Registration() {
    if (descriptor.is_open()) descriptor.release();
  }
  Registration(const Registration&) = delete;
  Registration& operator=(const Registration&) = delete;
  auto ready() { return descriptor.async_wait(asio::posix::descriptor_base::wait_read, asio::use_awaitable); }
  asio::posix::stream_descriptor descriptor;
  error_code error;  // for want of memory
};

asio::awaitable<void> PollSet::run() {
  for (;;) {
    co_await poll_when_woken();
    co_await poll_at_intervals();
  }
}

// Until two sockets were ready within a pause. To register the epoll takes longer the more sockets it has, so it is not
// done often.
asio::awaitable<void> PollSet::poll_when_woken() {
  Registration registration{loop_, all_};
  if (registration.error) co_return;
  for (std::int64_t received_at_us = 0;;) {
    co_await registration.ready();
    const std::int64_t now_us = clock_.steady_us();
    const std::size_t found = co_await poll_until_empty(all_);
    if (found > 1 || (found == 1 && now_us - received_at_us < kPause.count())) co_return;
    if (found == 1) received_at_us = now_us;
  }
}

// Until it has been quiet for a while.
asio::awaitable<void> PollSet::poll_at_intervals() {
  std::int64_t due_us = clock_.steady_us() + kPause.count();
  for (int quiet_rounds = 0; quiet_rounds < kQuietRounds;) {
    co_await clock_.sleep_until(due_us);
    due_us = clock_.steady_us() + kPause.count();
    const std::size_t found = co_await poll_until_empty(all_);
    quiet_rounds = found > 1 ? 0 : quiet_rounds + 1;
  }
}

asio::awaitable<void> PollSet::run_awaited() {
  Registration registration{loop_, awaited_};
  if (registration.error) throw boost::system::system_error{registration.error, "cannot watch robots"};
  for (;;) {
    co_await registration.ready();
    co_await poll_until_empty(awaited_);
  }
}

// In rounds that are a pause apart, so that many wake the loop once.
asio::awaitable<void> PollSet::run_quiet() {
  for (std::int64_t round_us = clock_.steady_us();;) {
    while (quiet_.empty()) co_await has_quiet_.wait();
    co_await clock_.sleep_until(std::max(quiet_.front()->due_us_, round_us + kPause.count()));
    round_us = clock_.steady_us();
    while (read_due(round_us) == kQuietAtOnce) co_await asio::post(loop_, asio::use_awaitable);
  }
}

// Some of the quiet; returns how many. The code that is called may destroy any socket.
std::size_t PollSet::read_due(std::int64_t now_us) {
  std::size_t count = 0;
  for (; count < kQuietAtOnce && !quiet_.empty() && quiet_.front()->due_us_ <= now_us; ++count) {
    Socket& socket = *quiet_.front();
    socket.due_us_ = now_us + kQuietPause.count();
    quiet_.splice(quiet_.end(), quiet_, quiet_.begin());
    socket.on_ready(EPOLLIN);
  }
  return count;
}

// Returns how many there were.
asio::awaitable<std::size_t> PollSet::poll_until_empty(Group& group) {
  for (std::size_t total = 0;;) {
    const std::size_t found = poll(group);
    total += found;
    if (found < kAtOnce) co_return total;
    co_await asio::post(loop_, asio::use_awaitable);
  }
}

// How many were ready. The code that is called may destroy any socket.
std::size_t PollSet::poll(Group& group) {
  const int found = ::epoll_wait(group.epoll, group.ready.data(), kAtOnce, 0);
  group.ready_count = static_cast<std::size_t>(std::max(found, 0));
  for (std::size_t at = 0; at < group.ready_count; ++at) {
    const epoll_event event = group.ready[at];
    if (event.data.ptr != nullptr) static_cast<Socket*>(event.data.ptr)->on_ready(event.events);
  }
  return std::exchange(group.ready_count, 0);
}

void PollSet::forget(const Socket& socket) {
  for (Group* group : {&all_, &awaited_}) {
    for (epoll_event& event : group->ready) {
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

void PollSet::Socket::set_pace(ReadPace pace) {
  if (pace == pace_) return;
  pace_ = pace;
  update();
}

void PollSet::Socket::set_quiet(bool quiet) {
  if (quiet == own_node_.empty()) return;
  if (!quiet) return own_node_.splice(own_node_.begin(), set_->quiet_, quiet_at_);
  due_us_ = set_->clock_.steady_us() + kQuietPause.count();
  quiet_at_ = own_node_.begin();
  if (set_->quiet_.empty()) set_->has_quiet_.notify();
  set_->quiet_.splice(set_->quiet_.end(), own_node_);
}

void PollSet::Socket::end_wait(error_code error) {
  if (!writer_) return;
  auto end = [on_end = std::exchange(writer_, nullptr), error]() mutable { on_end(error); };
  asio::post(loop_, std::move(end));
  update();
}

void PollSet::Socket::on_ready(std::uint32_t events) {
  constexpr std::uint32_t kEnd = EPOLLERR | EPOLLHUP | EPOLLRDHUP;
  if ((events & (EPOLLOUT | kEnd)) != 0) end_wait({});
  if (reader_ && (events & (EPOLLIN | kEnd)) != 0) reader_();
}

// An awaited socket stays in the epoll of all, with an empty mask: ready in both it would wake the loop twice, and to
// fill a mask cannot fail, so what is no longer awaited, or for want of memory never was, is read with the
// others. Of a quiet one that epoll still reports at once that the connection has ended.
// Where nobody reads or waits to write it is in none: an epoll reports the end of a connection whatever the mask,
// again and again.
bool PollSet::Socket::update() {
  if (set_ == nullptr) return !reader_ && !writer_;
  const std::uint32_t reading = reader_ ? EPOLLIN : 0, writing = writer_ ? EPOLLOUT : 0;
  const std::uint32_t at_once = (pace_ == ReadPace::awaited ? reading : 0) | writing;
  const bool is_set = set_events(set_->awaited_, in_awaited_, at_once != 0, at_once);
  const bool is_quiet = reader_ && pace_ == ReadPace::quiet;
  set_quiet(is_quiet);
  const bool is_read_there = pace_ == ReadPace::awaited && is_set;
  const std::uint32_t among_all = is_quiet ? EPOLLRDHUP : is_read_there ? 0 : reading;
  return set_events(set_->all_, in_all_, reading != 0, among_all) && is_set;
}

bool PollSet::Socket::set_events(const Group& group, std::optional<std::uint32_t>& present, bool is_wanted,
                                 std::uint32_t wanted) {
  if (is_wanted ? present == wanted : !present) return true;
  epoll_event event{};
  event.events = wanted;
  event.data.ptr = this;
  const int operation = !is_wanted ? EPOLL_CTL_DEL : present ? EPOLL_CTL_MOD : EPOLL_CTL_ADD;
  if (::epoll_ctl(group.epoll, operation, descriptor_, &event) != 0) return false;
  present = is_wanted ? std::optional{wanted} : std::nullopt;
  return true;
}

}  // namespace server::net
