// How many connections a port has at once: in all, of unauthenticated clients, and of one address.
//
//   auto slot = limiter.admit(address, from_loopback);   // once a connection was accepted
//   slot->on_end([&socket] { socket.end(); });           // how the limiter ends it
//   slot->becomes(ConnectionSlot::busy);                 // the client has authenticated itself
//
// A slot is unauthenticated until its client has shown who it is. When a place is needed (the port is full, or an
// address has its share), an address with a crowd of unauthenticated ones loses the oldest of them. Else the address
// with most places loses one: its oldest unauthenticated one, else the one that is idle the longest, else the oldest
// question that waits for its answer, else the long answer that moved least in the last second, if that was below
// kSlowAnswer. Busy ones are never evicted, and do not count there: pages, welcomed robots, and a stop or a change
// until it is answered. Where none can give way, `reserve` further ones are let in, under the same rule, for stops and
// health alone. Refusals are counted, and logged once a second.
//
// SAFETY: so those who take places, by whatever connections, take them from themselves; a stop finds one; and a
// connection over which somebody may be about to stop a robot stays.
//
// Loop thread. Outlives its slots.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/runtime/log.hpp"

namespace server::net {

inline constexpr std::size_t kMaxLeaving = 512;     // who was ended and has not gone yet still holds a descriptor
inline constexpr std::size_t kSlowAnswer = 64'000;  // bytes a second, below which a long answer may give way

struct ConnectionLimits {
  std::size_t connections = 256;
  std::size_t unauthenticated = 256;  // of them
  std::size_t of_address = 64;        // of one address, or one IPv6 network of 64 bits
  std::size_t of_loopback = 192;      // of one address of this machine, where other programs may stand for many
  std::size_t reserve = 0;            // beyond them
};

struct ConnectionCounters {
  std::uint64_t refused = 0;
  std::uint64_t replaced = 0;  // was evicted to another
};

class ConnectionLimiter {
 public:
  class Slot {
   public:
    // In the order in which they give way.
    enum State : std::uint8_t { unauthenticated, idle, waiting, sending, busy, leaving };

    Slot(ConnectionLimiter& limiter, const std::string& address, bool is_reserve);
    ~Slot();
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;

    // Ends the connection without destroying this slot at once. Called at most once, and not while it is busy.
    void on_end(std::function<void()> end) { end_ = std::move(end); }
    void becomes(State state);  // has no effect once it has given way
    void rest() {               // from what it did, if anything
      if (state_ != unauthenticated) becomes(idle);
    }
    void moved(std::size_t bytes);                   // of a long answer, to the client
    bool is_reserve() const { return is_reserve_; }  // for stops and health alone

   private:
    friend class ConnectionLimiter;
    struct Count {
      std::size_t slots = 0;
      std::size_t here = 0;      // of them, without those who leave and the reserve
      std::size_t yielding = 0;  // of these, without the busy ones
      std::size_t unauthenticated = 0;
      std::size_t in_reserve = 0;  // of the reserve, without the busy ones
    };
    using Counts = std::map<std::string, Count>;

    // Bytes in the last second and the present one.
    struct Pace {
      std::int64_t second = 0;
      std::size_t last = 0, now = 0;
      void turn(std::int64_t to);
    };

    void count(int sign) const;
    std::size_t pace() const;

    ConnectionLimiter& limiter_;
    Counts::iterator address_;
    const bool is_reserve_;
    State state_ = unauthenticated;
    Pace pace_;
    std::list<Slot*>::iterator place_;
    std::function<void()> end_ = [] {};
  };

  enum class Refusal : std::uint8_t {
    address_has_its_share,
    full,
  };

  // `port` is for the log: "http port".
  ConnectionLimiter(runtime::Clock& clock, const char* port, const ConnectionLimits& limits)
      : clock_{clock}, port_{port}, limits_{limits} {}
  ConnectionLimiter(const ConnectionLimiter&) = delete;
  ConnectionLimiter& operator=(const ConnectionLimiter&) = delete;

  std::expected<std::unique_ptr<Slot>, Refusal> admit(const std::string& address, bool from_loopback);

  // One gives its place up: the process has no descriptor left. False: nobody can.
  bool give_up_one();

  std::size_t connections() const;  // with those who leave
  const ConnectionCounters& counters() const { return counters_; }
  const ConnectionLimits& limits() const { return limits_; }

 private:
  using Slots = std::list<Slot*>;

  bool make_room(const std::string* address, bool is_reserve);
  Slot* first_of(Slot::State state, const std::string* address, bool is_reserve) const;
  Slot* oldest_of_crowd() const;
  bool is_full() const;
  Slot* first_of_all(const std::string* address, bool is_reserve) const;
  std::size_t unauthenticated() const;
  std::size_t in_reserve() const;
  std::unexpected<Refusal> refuse(const std::string& address, Refusal why);

  runtime::Clock& clock_;
  const char* port_;
  ConnectionLimits limits_;
  std::array<Slots, 6> slots_;  // by state, in the order in which they came into it
  Slot::Counts addresses_;
  ConnectionCounters counters_;
  runtime::SparseLines lines_;
};

using ConnectionSlot = ConnectionLimiter::Slot;

}  // namespace server::net
