// The machine's clocks, and a signal that is a timer which never expires by itself.
#include "server/runtime/clock.hpp"

#include <boost/asio/redirect_error.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <ctime>

namespace server::runtime {
namespace asio = boost::asio;

std::int64_t SystemClock::steady_us() const {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);  // std::chrono::steady_clock stands still in a suspend
  return std::int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000;
}

std::int64_t SystemClock::utc_us() const {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<microseconds>(now).count();
}

asio::awaitable<void> SystemClock::sleep_until(std::int64_t deadline_us, Alarm* alarm) {
  asio::steady_timer timer{loop_, microseconds{deadline_us - steady_us()}};
  if (alarm == nullptr) {
    co_await timer.async_wait(asio::use_awaitable);
    co_return;
  }
  if (alarm->has_rung_) co_return;
  alarm->timer_ = &timer;
  boost::system::error_code error;
  co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, error));
  alarm->timer_ = nullptr;
  if (error && !alarm->has_rung_) throw boost::system::system_error{asio::error::operation_aborted};
}

void Signal::notify() {
  ++notifications_;
  remembered_ = true;
  timer_.cancel();
  if (alarms_ == nullptr) return;
  for (Clock::Alarm* alarm : *alarms_) alarm->ring();
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

asio::awaitable<bool> Signal::wait_until(Clock& clock, std::int64_t deadline_us) {
  if (!remembered_) {
    const std::uint64_t before = notifications_;
    Clock::Alarm alarm;
    struct Entry {  // leaves the list also when the coroutine is cancelled, or destroyed after the signal
      std::shared_ptr<std::vector<Clock::Alarm*>> list;
      Clock::Alarm* alarm;
      ~Entry() { std::erase(*list, alarm); }
    };
    if (alarms_ == nullptr) alarms_ = std::make_shared<std::vector<Clock::Alarm*>>();
    alarms_->push_back(&alarm);
    const Entry entry{alarms_, &alarm};
    co_await clock.sleep_until(deadline_us, &alarm);
    if (!remembered_ && notifications_ == before) co_return false;
  }
  remembered_ = false;
  co_return true;
}

}  // namespace server::runtime
