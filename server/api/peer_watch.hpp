// Whether the other end of a WebSocket is there, reads what it gets, and does not talk too much.
//
// An end that is silent for 10 s is to be pinged; one that stays silent for 30 s, pings included, or takes 30 s for one
// message is given up. Of what it sends 500 messages a second are read; further ones wait in its socket. Loop thread.
#pragma once

#include <algorithm>
#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <limits>

#include "server/runtime/clock.hpp"

namespace server::api {

class PeerWatch {
 public:
  explicit PeerWatch(runtime::Clock& clock) : clock_{clock}, received_at_us_{clock.steady_us()} {}

  void on_received() { received_at_us_ = clock_.steady_us(); }

  // For each message that was read: its sender has sent too many, and the next is not to be read before resume_at_us().
  bool is_too_talkative() {
    if (received_at_us_ - second_began_us_ >= kSecondUs) {
      second_began_us_ = received_at_us_;
      received_in_second_ = 0;
    }
    return ++received_in_second_ > kMaxMessagesASecond;
  }
  std::int64_t resume_at_us() const { return second_began_us_ + kSecondUs; }

  void on_write_begun() { writing_since_us_ = clock_.steady_us(); }
  void on_written() { writing_since_us_ = kNever; }
  bool is_writing() const { return writing_since_us_ != kNever; }

  // True when it is to be pinged now; then not again for a while.
  bool take_ping() {
    const std::int64_t now_us = clock_.steady_us();
    if (now_us - std::max(received_at_us_, pinged_at_us_) < kPingAfterUs) return false;
    pinged_at_us_ = now_us;
    return true;
  }

  // Until it is given up; `each_second` is called about once a second meanwhile.
  template <class EachSecond>
  boost::asio::awaitable<void> wait_for_silence(EachSecond each_second) {
    for (;;) {
      const std::int64_t now_us = clock_.steady_us();
      if (now_us - received_at_us_ >= kSilenceUs) break;
      if (now_us >= writing_since_us_ + kWritingUs) break;
      co_await clock_.sleep_until(std::min(received_at_us_ + kSilenceUs, now_us + kSecondUs));
      each_second();
    }
  }

 private:
  static constexpr std::int64_t kSecondUs = 1'000'000;
  static constexpr std::int64_t kPingAfterUs = 10 * kSecondUs;
  static constexpr std::int64_t kSilenceUs = 30 * kSecondUs;
  static constexpr std::int64_t kWritingUs = 30 * kSecondUs;  // of one message
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max() / 2;
  static constexpr int kMaxMessagesASecond = 500;  // a page that drives a robot says some 20

  runtime::Clock& clock_;
  std::int64_t received_at_us_ = 0;
  std::int64_t pinged_at_us_ = 0;
  std::int64_t writing_since_us_ = kNever;
  std::int64_t second_began_us_ = 0;
  int received_in_second_ = 0;
};

}  // namespace server::api
