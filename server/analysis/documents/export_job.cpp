// Follows the program that writes the file.
#include "server/analysis/documents/export_job.hpp"

#include <fmt/format.h>

#include <exception>
#include <memory>
#include <utility>

#include "server/storage/export/export_child.hpp"
#include "server/storage/upkeep/export_space.hpp"

namespace server::analysis {
namespace asio = boost::asio;

namespace {

constexpr std::uint64_t kUsualPeriod_us = 10'000;

// To its end, until there is no room, or until it is cancelled. The child lives on the thread that follows it.
asio::awaitable<Result<void>> write_all(ExportParts parts, std::shared_ptr<storage::ExportChild> child,
                                        std::filesystem::path path, storage::JobRun& run) {
  for (Result<bool> more = true; *more;) {
    if (run.is_cancelled()) co_return fail(ErrorCode::conflict, "cancelled");
    auto slice = [child, folder = parts.files.folder()](SQLite::Database&) -> Result<bool> {
      if (const auto room = storage::room_for_more(folder); !room) return std::unexpected{room.error()};
      return child->advance();
    };
    more = co_await parts.exports.reader().ask(std::move(slice));
    if (!more) co_return std::unexpected{more.error()};
    auto look = [path, child] { return std::pair{storage::file_bytes(path), child->progress().share()}; };
    const auto [bytes, share] = co_await parts.exports.reader().run(std::move(look));
    if (bytes > storage::kMaxJobFileBytes) {
      co_return fail(
          ErrorCode::invalid,
          fmt::format("the file would have more than {} bytes; ask for the export itself", storage::kMaxJobFileBytes),
          "too_large");
    }
    run.report(share, fmt::format("writing: {:.1f} MB", 1e-6 * static_cast<double>(bytes)));
  }
  co_return Result<void>{};
}

// SAFETY: ended on the thread that follows it, whatever becomes of the job: waiting for its end would hold up stops
// here.
asio::awaitable<Result<void>> write_by_child(ExportParts parts, storage::ExportOrder order, storage::JobRun& run) {
  auto child = std::make_shared<storage::ExportChild>(order);
  Result<void> written;
  std::exception_ptr failure;
  try {
    written = co_await write_all(parts, child, order.file, run);
  } catch (...) {
    failure = std::current_exception();
  }
  co_await storage::end_export(parts.exports.reader(), std::move(child));
  if (failure) std::rethrow_exception(failure);
  co_return written;
}

}  // namespace

asio::awaitable<Result<void>> write_export(ExportParts parts, ExportRequest request, storage::JobRun& run) {
  if (auto may = parts.disk_watch.may_begin("an export to a file"); !may) co_return may;
  if (auto may = parts.slots.may_begin(); !may) co_return may;
  const runtime::Counted slot{parts.slots.taken};
  run.report(0, fmt::format("reading run {}", request.query.run));
  auto spans = co_await parts.exports.spans(storage::excerpt_of(request.query.run));
  if (!spans) co_return std::unexpected{spans.error()};
  for (storage::RecordedSpan& span : *spans) span.cut(span.made());
  const std::filesystem::path path = co_await parts.files.begin_draft(run.id());
  auto look = [folder = parts.files.folder(), spans = *spans, query = request.query](SQLite::Database& database) {
    const auto grid_us = static_cast<std::uint64_t>(query.grid_us.value_or(kUsualPeriod_us));
    return storage::room_for_export(folder, most_samples(database, spans) * (1 + kUsualPeriod_us / grid_us));
  };
  const auto room = co_await parts.exports.reader().ask(std::move(look));
  if (!room) co_return room;
  const auto stored = co_await parts.exports.store_waiting(std::move(*spans));
  if (!stored) co_return stored;
  storage::ExportOrder order{parts.database, request.format, request.query, path};
  co_return co_await write_by_child(parts, std::move(order), run);
}

}  // namespace server::analysis
