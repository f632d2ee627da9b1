// Sleeping is waiting for a timer that never expires; waking cancels that timer.
#include "tests/server/virtual_clock.hpp"

#include <algorithm>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/system_error.hpp>
#include <limits>

namespace server {
namespace asio = boost::asio;

asio::awaitable<void> VirtualClock::sleep_until(std::int64_t deadline_us, Alarm* alarm) {
  if (alarm != nullptr && alarm->has_rung_) co_return;
  bool due = deadline_us <= steady_us_;
  // A deadline in the past still lets others run once, as a real timer does.
  asio::steady_timer timer{loop_, due ? asio::steady_timer::time_point::min() : asio::steady_timer::time_point::max()};
  struct Entry {  // leaves the list also when the coroutine is cancelled or destroyed
    std::shared_ptr<Sleepers> list;
    Sleepers::iterator place;
    ~Entry() { list->erase(place); }
  };
  const Entry entry{sleepers_, sleepers_->emplace(deadline_us, Sleeper{&timer, &due})};
  if (alarm != nullptr) alarm->timer_ = &timer;
  boost::system::error_code error;
  co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, error));
  if (alarm != nullptr) alarm->timer_ = nullptr;
  const bool is_awake = due || (alarm != nullptr && alarm->has_rung_);
  if (!is_awake) throw boost::system::system_error{asio::error::operation_aborted};
}

void VirtualClock::settle() {
  const auto busy = [](const runtime::WorkerThread* worker) { return worker->jobs() > 0; };
  for (;;) {
    loop_.restart();
    if (loop_.poll() > 0) continue;
    if (std::ranges::none_of(workers_, busy)) return watch().rest();
    loop_.restart();
    loop_.run_one();
  }
}

void VirtualClock::advance_to(std::int64_t steady_us) {
  steady_us_ = std::max(steady_us_, steady_us);
  watch() = runtime::LoopWatch{};  // it was idle
  watch().turn(steady_us_);
  for (auto& [deadline_us, sleeper] : *sleepers_) {
    if (deadline_us > steady_us_) return;
    *sleeper.due = true;
    sleeper.timer->cancel();
  }
}

bool VirtualClock::advance_to_next() {
  if (sleepers_->empty()) return false;
  advance_to(sleepers_->begin()->first);
  return true;
}

bool VirtualClock::run_until(const std::function<bool()>& done, microseconds limit) {
  const std::int64_t end_us = steady_us_ + limit.count();
  for (;;) {
    settle();
    if (done() || sleepers_->empty()) return done();
    if (sleepers_->begin()->first > end_us) {
      advance_to(end_us);
      return done();
    }
    advance_to_next();
  }
}

void VirtualClock::run_for(microseconds duration) {
  const std::int64_t end_us = steady_us_ + duration.count();
  run_until([] { return false; }, duration);
  advance_to(end_us);
}

}  // namespace server
