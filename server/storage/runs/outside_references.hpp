// References of runs, for the API: stored on the disk thread in pieces, read on the readers'.
//
// Loop thread; what it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <memory>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/outside_reference.hpp"

namespace server::storage {

class OutsideReferences {
 public:
  OutsideReferences(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader)
      : clock_{clock}, recorder_{recorder}, reader_{reader} {}

  // Before the first import: what an earlier start did not finish counts as removed.
  boost::asio::awaitable<void> open();

  // not_found: no such run, or (reason no_reference) none of it.
  boost::asio::awaitable<Result<OutsideReference>> find(RunId run);
  // The same with a page of its positions, of one moment.
  boost::asio::awaitable<Result<StoredReference>> page(RunId run, std::optional<std::uint64_t> after_us,
                                                       std::size_t limit);

  // Whether an import could begin now: errors as below.
  boost::asio::awaitable<Result<void>> check(RunId run, std::string reason);
  boost::asio::awaitable<Result<MarkerPlace>> marker(RunId run, std::optional<std::int64_t> id, std::string text);
  // Answers when it is in use. Errors as check_may_import, and unavailable while the disk cannot be written.
  boost::asio::awaitable<Result<OutsideReference>> import(OutsideReference reference, OutsidePositions positions,
                                                          std::string reason, station::Author by);
  boost::asio::awaitable<Result<OutsideReference>> remove(RunId run, std::string reason, station::Author by);

  // Deletes positions that nobody can ask for any more.
  boost::asio::awaitable<void> sweep();

 private:
  boost::asio::awaitable<Result<void>> write(std::int64_t reference, std::shared_ptr<const OutsidePositions> positions);

  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
};

}  // namespace server::storage
