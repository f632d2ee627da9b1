// Starts, names and stops the station's coroutines.
#include "server/runtime/tasks.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <csignal>

namespace server::runtime {
namespace asio = boost::asio;

namespace {

constexpr std::chrono::milliseconds kPulse{50};  // a loop that has nothing to do shows so often that it runs

// Until the program has ended, also after the loop and what stands on it have gone: a signal that nobody waits for is
// kept by the registration, and ends nothing.
void hold_signals() {
  static auto* nobody = new asio::io_context;  // for ever
  static auto* held = new asio::signal_set{*nobody, SIGINT, SIGTERM};
  static_cast<void>(held);
}

const char* name_of(int signal) { return signal == SIGINT ? "SIGINT" : "SIGTERM"; }

}  // namespace

void TaskGroup::spawn(std::string name, asio::awaitable<void> task) {
  if (stopping_) return;
  const auto signal = signals_.emplace(signals_.end());
  auto on_end = [this, signal, name = std::move(name)](std::exception_ptr failure) {
    signals_.erase(signal);
    ended(name, failure);
    if (signals_.empty()) stop_signals_.cancel();  // nothing keeps the loop any more
  };
  asio::co_spawn(loop_, std::move(task), asio::bind_cancellation_slot(signal->slot(), std::move(on_end)));
}

void TaskGroup::run(Clock& clock) {
  while (!loop_.stopped()) {
    if (loop_.poll_one() == 0) {
      clock.watch().rest();
      loop_.run_one_for(kPulse);
    }
    clock.watch().turn(clock.steady_us());
  }
}

void TaskGroup::ended(const std::string& name, std::exception_ptr failure) {
  if (!failure) return;
  failure = first_of(failure);
  if (is_cancellation(failure)) return;
  spdlog::critical("{} failed: {}; stopping", name, text_of(failure));
  exit_code_ = 1;
  stop();
}

void TaskGroup::stop() {
  stopping_ = true;
  for (auto signal = signals_.begin(); signal != signals_.end();) {
    const auto current = signal++;  // emitting may end the task, which erases its signal
    current->emit(asio::cancellation_type::terminal);
  }
}

asio::awaitable<void> TaskGroup::stop_on_signal() {
  stop_signals_.add(SIGINT);
  stop_signals_.add(SIGTERM);
  const int number = co_await stop_signals_.async_wait(asio::use_awaitable);
  hold_signals();
  spdlog::info("stopping on {}", name_of(number));
  ignore_later_signals(false);
  stop();
}

void TaskGroup::ignore_later_signals(bool is_said) {
  stop_signals_.async_wait([this, is_said](const boost::system::error_code& error, int number) {
    if (error || signals_.empty()) return;  // nothing keeps the loop any more
    if (!is_said) spdlog::info("{} again: it is stopping, and stores what was received", name_of(number));
    ignore_later_signals(true);
  });
}

}  // namespace server::runtime
