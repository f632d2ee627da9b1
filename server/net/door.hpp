// Who may be connected to a port at once: how many in all, and how many from one address.
//
//   auto guest = door.admit(address, from_loopback);   // once a connection was accepted
//   guest->on_end([&socket] { socket.end(); });        // how the door ends it
//   guest->becomes(Guest::busy);                       // it has shown who it is
//
// A guest is a stranger until it has shown who it is. An address that has its share gives up one of its own for a new
// one: its oldest stranger, else the one that is idle the longest. When the door is full, whoever has most strangers
// gives one up, else the one idle the longest. Busy guests never give way, and where nobody does, the new one is
// refused; refusals are counted, and logged once a second.
// SAFETY: so a flood from one address keeps nobody at another out, and one of strangers not even those at its own; and
// a connection over which somebody may be about to stop a robot stays.
// Loop thread. Outlives its guests.
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

namespace server {

struct DoorLimits {
  std::size_t connections = 256;
  std::size_t strangers = 256;    // of them, who have not shown who they are
  std::size_t of_address = 64;    // of one address, or one IPv6 network of 64 bits
  std::size_t of_loopback = 192;  // of one address of this machine, where other programs may stand for many
};

struct DoorCounters {
  std::uint64_t refused = 0;
  std::uint64_t replaced = 0;  // gave way to another
};

class Door {
 public:
  class Guest {
   public:
    enum State : std::uint8_t { stranger, idle, busy, leaving };

    Guest(Door& door, const std::string& address);
    ~Guest();
    Guest(const Guest&) = delete;
    Guest& operator=(const Guest&) = delete;

    // Ends the connection without destroying this guest at once. Called at most once, and not while it is busy.
    void on_end(std::function<void()> end) { end_ = std::move(end); }
    void becomes(State state);  // has no effect once it has given way
    void rest() {               // from what kept it busy, if anything did
      if (state_ == busy) becomes(idle);
    }

   private:
    friend class Door;
    struct Count {
      std::size_t guests = 0;
      std::size_t here = 0;  // of them, without those who leave
      std::size_t strangers = 0;
    };
    using Counts = std::map<std::string, Count>;

    void count(int sign) const;

    Door& door_;
    Counts::iterator address_;
    State state_ = stranger;
    std::list<Guest*>::iterator place_;
    std::function<void()> end_ = [] {};
  };

  enum class Refusal : std::uint8_t {
    address_has_its_share,
    full,
  };

  // `port` is for the log: "http port".
  Door(Clock& clock, const char* port, const DoorLimits& limits) : clock_{clock}, port_{port}, limits_{limits} {}
  Door(const Door&) = delete;
  Door& operator=(const Door&) = delete;

  std::expected<std::unique_ptr<Guest>, Refusal> admit(const std::string& address, bool from_loopback);

  std::size_t connections() const;  // with those who leave
  const DoorCounters& counters() const { return counters_; }
  const DoorLimits& limits() const { return limits_; }

 private:
  using Guests = std::list<Guest*>;

  bool make_room(const std::string* address);
  Guest* first_of(Guest::State state, const std::string* address) const;
  bool is_full() const;
  std::unexpected<Refusal> refuse(const std::string& address, Refusal why);

  Clock& clock_;
  const char* port_;
  DoorLimits limits_;
  std::array<Guests, 4> guests_;  // by state, in the order in which they came into it
  Guest::Counts addresses_;
  DoorCounters counters_;
  SparseLines lines_;
};

using Guest = Door::Guest;

}  // namespace server
