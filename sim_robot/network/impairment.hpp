// One direction of a bad TCP connection, in virtual time and without sockets: bytes go in, and come out later.
//
// TCP delivers in order, so nothing is lost, doubled or overtaken here. Impairments of segments show as delays:
//
//   sent    = max(now, sent of the one before) + size / bytes_per_s                        (1)   throttle
//   arrival = sent + delay + uniform(0, jitter) + rto · (2^k - 1), k losses in a row      (2)   loss: the time-out
//   doubles due     = max(arrival, due of the one before)                                          (3)   order
//
// A segment is at most 1460 bytes, and on a throttled link at most 10 ms of it. Between stall() and its end nothing
// arrives; the segment that was lost first is then sent again at rto · (2^k - 1) after its time, so that an old
// connection revives up to as long after the stall as the stall was. A stall without end is a half-open connection: it
// takes what its buffer holds and delivers nothing.
// Errors:   check() throws std::invalid_argument, quoting the value. Times may not go back.
// Differs from TCP: no fast retransmission, which needs traffic behind the loss; no congestion control.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

#include "protocol/frame.hpp"
#include "sim_robot/world/microseconds.hpp"

namespace sim_robot {

struct Impairment {
  double delay_s = 0;
  double jitter_s = 0;              // at most so much more, uniform
  double bytes_per_s = 0;           // 0: no throttle
  double loss_probability = 0;      // of a segment, each time it is sent; in [0, 1)
  double retransmit_s = 0.2;        // rto
  std::size_t split_bytes = 0;      // the most that come out at once; 1: every byte by itself; 0: no limit
  std::size_t buffer_bytes = 4096;  // taken and not yet out; the robot's TCP stack holds about as much
};

// Throws std::invalid_argument that names and quotes an impossible value.
void check(const Impairment& impairment);

class ImpairedStream {
 public:
  static constexpr std::uint64_t kNever = kNeverUs;

  ImpairedStream(const Impairment& impairment, std::uint64_t seed);

  // Takes as many bytes as the buffer has room for and returns their number; the caller offers the rest again.
  std::size_t push(protocol::Bytes bytes, std::uint64_t now_us);
  // Ends the stream: the end follows the last byte as a segment of its own. Nothing is taken after it.
  void close(std::uint64_t now_us);
  // Ends the stream after this number of the bytes under way, and drops the rest.
  void cut(std::size_t after_bytes, std::uint64_t now_us);
  // Returns the bytes that are due by now: at most split_bytes, and 0 when there are none.
  std::size_t pull(std::uint8_t* out, std::size_t capacity, std::uint64_t now_us);
  // Every byte and the end have been pulled.
  bool ended(std::uint64_t now_us) const;

  // Nothing arrives from now until then; kNever: half-open. A later call replaces the end of an earlier one.
  void stall(std::uint64_t now_us, std::uint64_t until_us);
  // Ends a stall, also a half-open one: waiting bytes arrive now.
  void resume(std::uint64_t now_us);
  // Holds for bytes pushed from now on; bytes that wait for a throttle come as early as the new one allows.
  void impair(const Impairment& impairment, std::uint64_t now_us);

  // When the next byte or the end is due; empty when nothing is under way, or for ever.
  std::optional<std::uint64_t> next_at_us() const;
  std::size_t room() const {
    return closed_ ? 0 : impairment_.buffer_bytes - std::min(held_, impairment_.buffer_bytes);
  }
  std::size_t held() const { return held_; }
  bool closed() const { return closed_; }

 private:
  struct Segment {
    std::vector<std::uint8_t> bytes;  // empty: the end of the stream
    std::uint64_t due_us = 0;
    std::size_t taken = 0;  // of bytes, by pull()
  };
  void hurry(std::uint64_t now_us);
  std::uint64_t due_us(std::size_t size, std::uint64_t now_us);
  std::uint64_t after_stall(std::uint64_t arrival_us);
  std::uint64_t retransmission_us(int losses) const;
  std::size_t segment_bytes() const;

  Impairment impairment_;
  std::mt19937_64 random_;
  std::deque<Segment> segments_;
  std::size_t held_ = 0;
  bool closed_ = false;
  std::uint64_t sent_us_ = 0, last_due_us_ = 0;
  std::uint64_t stalled_until_us_ = 0;
  std::optional<std::uint64_t> revived_at_us_;  // when the first segment of the stall is sent again and arrives
};

}  // namespace sim_robot
