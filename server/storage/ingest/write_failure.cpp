#include "server/storage/ingest/write_failure.hpp"

#include <spdlog/spdlog.h>

#include "server/runtime/clock.hpp"

namespace server::storage {
using namespace std::chrono_literals;

namespace {

constexpr microseconds kRetryInterval = 1s;
constexpr microseconds kLogInterval = 10s;

}  // namespace

void WriteFailure::on_failed(const std::string& problem, const std::filesystem::path& path, std::int64_t now_us) {
  problem_ = problem;
  if (!is_failing() || now_us - logged_us_ >= kLogInterval.count()) {
    logged_us_ = now_us;
    spdlog::error(
        "nothing is recorded now, {} cannot be written: {}; it is tried again every second, and the robots keep what "
        "they can",
        path.string(), problem);
  }
  retry_at_us_ = now_us + kRetryInterval.count();
}

void WriteFailure::on_written() {
  if (is_failing()) spdlog::info("recording goes on: what had waited for the disk is stored");
  retry_at_us_ = 0;
  problem_.clear();
}

}  // namespace server::storage
