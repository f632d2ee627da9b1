// How many connections a port has at once: in all, of unauthenticated clients, and of one address.
//
//   auto slot = limiter.admit(address, from_loopback);   // once a connection was accepted
//   slot->on_end([&socket] { socket.end(); });           // how the limiter ends it
//   slot->becomes(ConnectionSlot::busy);                 // the client has authenticated itself
//
// A slot is unauthenticated until its client has shown who it is. An address that has all its slots loses one for a new
// connection: its oldest unauthenticated one, else the one that is idle the longest. When the port is full, the address
// with the most unauthenticated slots loses one, else the slot that is idle the longest. Busy slots are never evicted;
// where none can be, the new connection is refused. Refusals are counted, and logged once a second.
// SAFETY: so a flood from one address keeps no other address out, and a flood of unauthenticated connections not even
// other clients of its own address; and a connection over which somebody may be about to stop a robot stays.
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

struct ConnectionLimits {
  std::size_t connections = 256;
  std::size_t unauthenticated = 256;  // of them
  std::size_t of_address = 64;        // of one address, or one IPv6 network of 64 bits
  std::size_t of_loopback = 192;      // of one address of this machine, where other programs may stand for many
};

struct ConnectionCounters {
  std::uint64_t refused = 0;
  std::uint64_t replaced = 0;  // was evicted to another
};

class ConnectionLimiter {
 public:
  class Slot {
   public:
    enum State : std::uint8_t { unauthenticated, idle, busy, leaving };

    Slot(ConnectionLimiter& limiter, const std::string& address);
    ~Slot();
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;

    // Ends the connection without destroying this slot at once. Called at most once, and not while it is busy.
    void on_end(std::function<void()> end) { end_ = std::move(end); }
    void becomes(State state);  // has no effect once it has given way
    void rest() {               // from what kept it busy, if anything did
      if (state_ == busy) becomes(idle);
    }

   private:
    friend class ConnectionLimiter;
    struct Count {
      std::size_t slots = 0;
      std::size_t here = 0;  // of them, without those who leave
      std::size_t unauthenticated = 0;
    };
    using Counts = std::map<std::string, Count>;

    void count(int sign) const;

    ConnectionLimiter& limiter_;
    Counts::iterator address_;
    State state_ = unauthenticated;
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

  std::size_t connections() const;  // with those who leave
  const ConnectionCounters& counters() const { return counters_; }
  const ConnectionLimits& limits() const { return limits_; }

 private:
  using Slots = std::list<Slot*>;

  bool make_room(const std::string* address);
  Slot* first_of(Slot::State state, const std::string* address) const;
  bool is_full() const;
  std::unexpected<Refusal> refuse(const std::string& address, Refusal why);

  runtime::Clock& clock_;
  const char* port_;
  ConnectionLimits limits_;
  std::array<Slots, 4> slots_;  // by state, in the order in which they came into it
  Slot::Counts addresses_;
  ConnectionCounters counters_;
  runtime::SparseLines lines_;
};

using ConnectionSlot = ConnectionLimiter::Slot;

}  // namespace server::net
