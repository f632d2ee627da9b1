#include "server/experiments/runner/stubborn_writer.hpp"

#include <spdlog/spdlog.h>

#include <chrono>

namespace server::experiments {
namespace {

constexpr microseconds kAgainAfter = std::chrono::seconds{1};

}  // namespace

boost::asio::awaitable<void> StubbornWriter::keep(std::string what, std::function<void(storage::Database&)> change) {
  for (;;) {
    auto job = [change](storage::Database& database) -> std::string {
      try {
        change(database);
        return {};
      } catch (const SQLite::Exception& error) {
        return error.what();
      }
    };
    const std::string problem = co_await recorder_.on_disk(std::move(job));
    if (problem.empty()) co_return;
    spdlog::error("{} cannot be stored: {}; it is tried again", what, problem);
    co_await clock_.sleep_for(kAgainAfter);
  }
}

}  // namespace server::experiments
