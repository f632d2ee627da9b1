// Many sockets behind one descriptor of the loop: an epoll of their own, so that a sending fleet wakes the loop at most
// 500 times a second, for a few microseconds each.
//
//   sockets ─┬─ epoll of all ────────── polled every 2 ms ──────────── a few sockets, then the loop's other work
//            ├─ epoll of the awaited ── polled when one is ready ────── a few, then the other work
//            └─ list of the quiet ───── each read every 30 ms ───────── a few, then the other work
//
// The second is for sockets from which an answer is expected, and those with a waiting writer. When hardly any robot
// sends, the first is polled when a socket is ready, too. The third is for sockets for whose bytes nobody waits: one
// read, and one acknowledgement by the kernel, for all that has come meanwhile. Loop thread. After the set is destroyed
// no wait on its sockets ends.
#pragma once

#include <sys/epoll.h>

#include <array>
#include <boost/asio/async_result.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/error_code.hpp>
#include <cstdint>
#include <functional>
#include <list>
#include <optional>
#include <unordered_set>

#include "server/net/read_pace.hpp"
#include "server/runtime/clock.hpp"

namespace server::net {

class PollSet {
 public:
  static constexpr int kAtOnce = 8;                         // sockets a poll round, before the loop does its other work
  static constexpr std::chrono::microseconds kPause{2000};  // from one poll of all sockets to the next
  static constexpr int kQuietRounds = 5;  // rounds with one ready at most, until the loop is woken instead
  // From one read of a quiet socket to the next, and how many a turn: each has the frames of a whole pause. Shorter
  // than the 40 ms after which Linux acknowledges by itself what was not read.
  static constexpr std::chrono::microseconds kQuietPause{30'000};
  static constexpr int kQuietAtOnce = 4;

  PollSet(boost::asio::io_context& loop, runtime::Clock& clock);
  ~PollSet();  // the loop resumes those that still wait
  PollSet(const PollSet&) = delete;
  PollSet& operator=(const PollSet&) = delete;

  // Poll until cancelled. Without them no wait ends.
  boost::asio::awaitable<void> run();
  boost::asio::awaitable<void> run_awaited();
  boost::asio::awaitable<void> run_quiet();

  class Socket;

 private:
  // One epoll.
  struct Group {
    Group();
    ~Group();
    Group(const Group&) = delete;
    Group& operator=(const Group&) = delete;
    int epoll;
    std::array<epoll_event, kAtOnce> ready{};  // of the present round
    std::size_t ready_count = 0;
  };

  struct Registration;

  boost::asio::awaitable<void> poll_at_intervals();
  boost::asio::awaitable<void> poll_when_woken();
  boost::asio::awaitable<std::size_t> poll_until_empty(Group& group);
  std::size_t poll(Group& group);
  std::size_t read_due(std::int64_t now_us);
  void forget(const Socket& socket);

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  Group all_, awaited_;
  std::unordered_set<Socket*> sockets_;
  std::list<Socket*> quiet_;  // in the order in which they are due
  runtime::Signal has_quiet_;
};

// A descriptor in the set, which stays its owner's and outlives this. Nobody waits any more when it is destroyed.
class PollSet::Socket {
 public:
  Socket(PollSet& set, int descriptor);
  ~Socket();
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  // Calls it in the socket's turn, again and again, while there is something to read or the connection has ended; a
  // quiet one's also when there is nothing. It does not throw, nor destroy the socket. Null: no longer. Not from inside
  // of the call. Throws bad_alloc.
  void watch(std::function<void()> on_readable);

  // Returns when there is room to write, or the connection has ended. One at a time. Throws operation_aborted when
  // cancelled, no_memory when the system cannot watch it.
  boost::asio::awaitable<void> writable();

  // The pace at which unread and later bytes are reported; prompt until it is set.
  void set_pace(ReadPace pace);

 private:
  friend class PollSet;
  using Waiter = std::move_only_function<void(boost::system::error_code)>;

  void end_wait(boost::system::error_code error);
  void on_ready(std::uint32_t events);
  bool update();
  void set_quiet(bool quiet);
  bool set_events(const Group& group, std::optional<std::uint32_t>& present, bool is_wanted, std::uint32_t wanted);

  boost::asio::io_context& loop_;
  PollSet* set_;  // null when it is gone
  int descriptor_;
  std::optional<std::uint32_t> in_all_, in_awaited_;  // the events that each epoll waits for, where the socket is in it
  ReadPace pace_ = ReadPace::prompt;
  std::list<Socket*> own_node_{this};  // empty while it is in the list of the quiet, at quiet_at_
  std::list<Socket*>::iterator quiet_at_;
  std::int64_t due_us_ = 0;  // there
  std::function<void()> reader_;
  Waiter writer_;
};

}  // namespace server::net
