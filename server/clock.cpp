// The machine's clocks, and a signal that is a timer which never expires by itself.
#include "server/clock.hpp"

#include <boost/asio/redirect_error.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>

namespace server {
namespace asio = boost::asio;

std::int64_t SystemClock::steady_us() const {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration_cast<microseconds>(now).count();
}

std::int64_t SystemClock::utc_us() const {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<microseconds>(now).count();
}

asio::awaitable<void> SystemClock::sleep_until(std::int64_t deadline_us) {
  asio::steady_timer timer{loop_, std::chrono::steady_clock::time_point{microseconds{deadline_us}}};
  co_await timer.async_wait(asio::use_awaitable);
}

void Signal::notify() {
  ++notifications_;
  remembered_ = true;
  timer_.cancel();
}

asio::awaitable<void> Signal::wait() {
  const std::uint64_t before = notifications_;
  while (!remembered_ && notifications_ == before) {
    boost::system::error_code error;
    co_await timer_.async_wait(asio::redirect_error(asio::use_awaitable, error));
    const auto cancelled = (co_await asio::this_coro::cancellation_state).cancelled();
    if (cancelled != asio::cancellation_type::none) throw boost::system::system_error{asio::error::operation_aborted};
  }
  remembered_ = false;
}

}  // namespace server
