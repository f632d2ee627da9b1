// A statement each.
#include "server/storage/runs/run_metrics.hpp"

#include <fmt/format.h>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace asio = boost::asio;

asio::awaitable<std::optional<StoredMetrics>> MetricsOfRuns::find(RunId run, int version, std::int64_t samples,
                                                                  std::int64_t reference_us) {
  auto query = [=](SQLite::Database& database) -> std::optional<StoredMetrics> {
    SQLite::Statement row{database,
                          "SELECT program, samples, computed_at_us, document FROM run_metrics"
                          " WHERE run_id = ? AND version = ? AND samples >= ? AND reference_us = ?"};
    bind_all(row, run, std::int64_t{version}, samples, reference_us);
    if (!row.executeStep()) return std::nullopt;
    return StoredMetrics{run,
                         version,
                         row.getColumn(0).getString(),
                         row.getColumn(1).getInt64(),
                         reference_us,
                         row.getColumn(2).getInt64(),
                         row.getColumn(3).getString()};
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<void>> MetricsOfRuns::store(StoredMetrics metrics) {
  auto job = [metrics = std::move(metrics)](Database& database) -> Result<void> {
    try {
      SQLite::Statement put{database.handle(),
                            "INSERT OR REPLACE INTO run_metrics (run_id, version, program, samples, reference_us,"
                            " computed_at_us, document) VALUES (?, ?, ?, ?, ?, ?, ?)"};
      execute(put, metrics.run, std::int64_t{metrics.version}, metrics.program, metrics.samples, metrics.reference_us,
              metrics.computed_at_us, metrics.document);
      return {};
    } catch (const SQLite::Exception& error) {
      return fail(ErrorCode::unavailable, fmt::format("the metrics could not be stored: {}", runtime::text_of(error)),
                  "not_stored");
    }
  };
  co_return co_await recorder_.on_disk(std::move(job));
}

}  // namespace server::storage
