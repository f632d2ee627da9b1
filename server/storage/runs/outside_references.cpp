// Each piece is a job of the disk thread, so that commits go in between.
#include "server/storage/runs/outside_references.hpp"

#include <fmt/format.h>

#include <type_traits>
#include <utility>

#include "server/storage/runs/run_queries.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

Error reference_not_stored() {
  return {ErrorCode::unavailable, "the disk cannot be written now; the station's log says why. Try again", {}};
}

// What SQLite throws where the disk is full or fails, as a value.
template <class Job>
auto on_writable_disk(Job job) {
  return [job = std::move(job)](Database& database) mutable -> std::invoke_result_t<Job&, Database&> {
    try {
      return job(database);
    } catch (const SQLite::Exception&) {
      return std::unexpected{reference_not_stored()};
    }
  };
}

}  // namespace

asio::awaitable<void> OutsideReferences::open() {
  auto job = [utc_us = clock_.utc_us()](Database& database) {
    remove_unfinished_references(database.handle(), {}, utc_us);
    return true;
  };
  co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<Result<OutsideReference>> OutsideReferences::find(RunId run) {
  const std::optional<std::uint64_t> from_the_first;
  auto found = co_await page(run, from_the_first, 0);
  if (!found) co_return std::unexpected{found.error()};
  co_return std::move(found->reference);
}

asio::awaitable<Result<StoredReference>> OutsideReferences::page(RunId run, std::optional<std::uint64_t> after_us,
                                                                 std::size_t limit) {
  auto query = [run, after_us, limit](SQLite::Database& database) -> Result<StoredReference> {
    if (!read_run_state(database, run)) return fail(ErrorCode::not_found, fmt::format("there is no run {}", run));
    auto found = read_reference(database, run, after_us, limit);
    if (found) return std::move(*found);
    return fail(ErrorCode::not_found, fmt::format("run {} has no reference", run), "no_reference");
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<void>> OutsideReferences::check(RunId run, std::string reason) {
  auto query = [run, reason](SQLite::Database& database) { return check_may_import(database, run, reason); };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<MarkerPlace>> OutsideReferences::marker(RunId run, std::optional<std::int64_t> id,
                                                               std::string text) {
  auto query = [run, id, text](SQLite::Database& database) { return find_marker(database, run, id, text); };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<void>> OutsideReferences::write(std::int64_t reference,
                                                       std::shared_ptr<const OutsidePositions> positions) {
  for (std::size_t first = 0; first < positions->size(); first += kReferenceSlice) {
    auto job = on_writable_disk([reference, positions, first](Database& database) -> Result<void> {
      add_positions(database.handle(), reference, *positions, first, kReferenceSlice);
      return {};
    });
    const Result<void> written = co_await recorder_.on_disk(std::move(job));
    if (!written) co_return written;
  }
  co_return Result<void>{};
}

asio::awaitable<Result<OutsideReference>> OutsideReferences::import(OutsideReference reference,
                                                                    OutsidePositions positions, std::string reason,
                                                                    station::Author by) {
  auto begin = on_writable_disk(
      [reference, reason](Database& database) { return begin_reference(database.handle(), reference, reason); });
  const Result<std::int64_t> id = co_await recorder_.on_disk(std::move(begin));
  if (!id) co_return std::unexpected{id.error()};
  const auto all = std::make_shared<const OutsidePositions>(std::move(positions));
  Result<void> done = co_await write(*id, all);
  if (done) {
    auto complete = on_writable_disk(
        [id = *id, reason, by](Database& database) { return complete_reference(database.handle(), id, reason, by); });
    done = co_await recorder_.on_disk(std::move(complete));
  }
  if (!done) {
    auto forget = on_writable_disk([at_us = by.at_us, id = *id](Database& database) -> Result<void> {
      remove_unfinished_references(database.handle(), id, at_us);
      return {};
    });
    co_await recorder_.on_disk(std::move(forget));
    co_return std::unexpected{done.error()};
  }
  co_await sweep();
  co_return co_await find(reference.run);
}

asio::awaitable<Result<OutsideReference>> OutsideReferences::remove(RunId run, std::string reason, station::Author by) {
  auto found = co_await find(run);
  if (!found) co_return found;
  auto job = on_writable_disk(
      [run, reason, by](Database& database) { return remove_reference(database.handle(), run, reason, by); });
  const Result<void> removed = co_await recorder_.on_disk(std::move(job));
  if (!removed) co_return std::unexpected{removed.error()};
  co_await sweep();
  co_return found;
}

asio::awaitable<void> OutsideReferences::sweep() {
  for (bool more = true; more;) {
    auto job =
        on_writable_disk([](Database& database) -> Result<bool> { return delete_some_positions(database.handle()); });
    more = (co_await recorder_.on_disk(std::move(job))).value_or(false);
  }
}

}  // namespace server::storage
