// By libsystemd's sd_notify.
#include "server/config/supervision.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include <chrono>
#include <cstdint>
#include <cstring>

namespace server::config {
namespace {

constexpr int kKeepEnvironment = 0;
constexpr std::chrono::hours kUnwatched{24};  // nobody counts the signs of life

void say(const std::string& state) {
  // When it fails there is nobody to tell, and the supervisor acts by its time limits.
  if (const int result = sd_notify(kKeepEnvironment, state.c_str()); result < 0) {
    spdlog::debug("the supervisor cannot be told '{}': {}", state, std::strerror(-result));
  }
}

struct SaysStopping {
  ~SaysStopping() { say("STOPPING=1"); }
};

}  // namespace

boost::asio::awaitable<void> tell_supervisor(runtime::Clock& clock, std::string status) {
  constexpr int kSignsInTime = 3;
  std::uint64_t watchdog_us = 0;
  const bool is_watched = sd_watchdog_enabled(kKeepEnvironment, &watchdog_us) > 0;
  const std::chrono::microseconds interval =
      is_watched ? std::chrono::microseconds{watchdog_us / kSignsInTime} : kUnwatched;
  say(fmt::format("READY=1\nSTATUS={}", status));
  const SaysStopping at_end;
  for (;;) {
    if (is_watched) say("WATCHDOG=1");
    co_await clock.sleep_for(interval);
  }
}

}  // namespace server::config
