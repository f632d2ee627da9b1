// A run as the body of an answer: CSV line by line as it is read, other formats from a file that is made first.
//
// Loop thread; the work is done on the exports' worker in slices of 20 ms, and no faster than the client takes it, so
// that memory does not grow with the run, and the work stops when the client disconnects.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "server/api/routes/routes.hpp"
#include "server/http/http.hpp"
#include "server/runtime/tasks.hpp"
#include "server/storage/export/csv_writer.hpp"
#include "server/storage/export/export_child.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/upkeep/export_space.hpp"

namespace server::api {

class CsvStream final : public http::BodyStream {
 public:
  // `exports` is the history on the exports' worker.
  CsvStream(storage::History& exports, std::vector<storage::RecordedSpan> spans, const storage::ExportQuery& query)
      : exports_{exports}, writer_{std::move(spans), query} {}

  boost::asio::awaitable<Result<std::optional<std::string>>> next() override;

 private:
  storage::History& exports_;
  storage::CsvWriter writer_;
};

// Destroys what holds a file where the file was written: to close or to remove gigabytes takes long.
class EndOnWorker {
 public:
  EndOnWorker(runtime::TaskGroup& tasks, storage::DatabaseReader& reader) : tasks_{&tasks}, reader_{&reader} {}

  template <class T>
  void operator()(T* object) const {
    auto end = [whole = std::unique_ptr<T>{object}]() mutable { whole.reset(); };
    tasks_->spawn("end of an export", reader_->run(std::move(end)));
  }
  void operator()(storage::ExportChild* child) const {
    tasks_->spawn("end of an export", storage::end_export(*reader_, std::shared_ptr<storage::ExportChild>{child}));
  }

 private:
  runtime::TaskGroup* tasks_;
  storage::DatabaseReader* reader_;
};

// A file that is there for one answer: removed when this is destroyed.
class ExportFile {
 public:
  // In this folder, which is made if need be; the name ends with this. Throws when it cannot be made.
  ExportFile(const std::filesystem::path& folder, const std::string& ending);
  ~ExportFile();
  ExportFile(const ExportFile&) = delete;
  ExportFile& operator=(const ExportFile&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

using ExportFilePtr = std::unique_ptr<ExportFile, EndOnWorker>;

// An empty file for what is made of these samples, with this number of rows each; low_space: there is no room for it.
boost::asio::awaitable<Result<ExportFilePtr>> begin_export_file(ExportRoutes parts,
                                                                std::vector<storage::RecordedSpan> spans,
                                                                std::uint64_t rows_per_sample, std::string ending);

// A slice of a writer on this thread; of one that is another program, a wait for it.
template <class Writer>
Result<bool> advance(Writer& writer, SQLite::Database& database) {
  return writer.advance(database);
}
inline Result<bool> advance(storage::ExportChild& child, SQLite::Database&) { return child.advance(); }

// To its end, or until there is no room: nobody knows before how long the gaps of a grid are.
template <class Writer>
boost::asio::awaitable<Result<void>> write_in_slices(ExportRoutes parts, Writer& writer) {
  for (Result<bool> more = true; *more;) {
    auto slice = [&writer, folder = parts.folder](SQLite::Database& database) -> Result<bool> {
      if (const auto room = storage::room_for_more(folder); !room) return std::unexpected{room.error()};
      return advance(writer, database);
    };
    more = co_await parts.history.reader().ask(std::move(slice));
    if (!more) co_return std::unexpected{more.error()};
  }
  co_return Result<void>{};
}

class FileStream final : public http::BodyStream {
 public:
  FileStream(storage::History& exports, ExportFilePtr file) : exports_{exports}, file_{std::move(file)} {}

  boost::asio::awaitable<Result<std::optional<std::string>>> next() override;

 private:
  storage::History& exports_;
  ExportFilePtr file_;
  std::uint64_t sent_bytes_ = 0;
};

}  // namespace server::api
