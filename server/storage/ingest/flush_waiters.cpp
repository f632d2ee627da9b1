#include "server/storage/ingest/flush_waiters.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kFlushPatience = 3s;

}  // namespace

asio::awaitable<bool> FlushWaiters::wait_for(std::uint64_t position) {
  // Who gave up is dropped here, too: while the disk fails nothing else does it.
  std::erase_if(waiters_, [](const Waiter& waiter) { return waiter.done.expired(); });
  const auto done = std::make_shared<runtime::Signal>(loop_);
  waiters_.push_back({done, position});
  wanted_.notify();
  co_return co_await done->wait_until(clock_, clock_.steady_us() + kFlushPatience.count());
}

asio::awaitable<void> FlushWaiters::until_wanted(std::int64_t steady_us) {
  while (waiters_.empty() && clock_.steady_us() < steady_us) {
    co_await wanted_.wait_until(clock_, steady_us);
  }
}

void FlushWaiters::on_commit_built() {
  for (Waiter& waiter : waiters_) waiter.is_in_commit = true;
}

void FlushWaiters::on_durable(std::uint64_t position) {
  std::erase_if(waiters_, [position](const Waiter& waiter) {
    if (!waiter.is_in_commit || waiter.position > position) return false;
    if (const auto done = waiter.done.lock()) done->notify();
    return true;
  });
}

}  // namespace server::storage
