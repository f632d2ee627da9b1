// Pieces of bodies, made on the worker.
#include "server/api/routes/csv_export.hpp"

#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <system_error>

#include "server/storage/upkeep/disk_watch.hpp"

namespace server::api {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kPieceBytes = 256 * 1024;

std::string read_piece(const std::filesystem::path& path, std::uint64_t offset) {
  std::ifstream file{path, std::ios::binary};
  file.seekg(static_cast<std::streamoff>(offset));
  std::string piece(kPieceBytes, '\0');
  file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
  piece.resize(static_cast<std::size_t>(file.gcount()));
  return piece;
}

// Makes the empty file, if there is room for what comes into it.
Result<std::unique_ptr<ExportFile>> make_file(const std::filesystem::path& folder, const std::string& ending,
                                              std::uint64_t samples) {
  auto file = std::make_unique<ExportFile>(folder, ending);
  if (const auto room = storage::room_for_export(folder, samples); !room) return std::unexpected{room.error()};
  return file;
}

}  // namespace

asio::awaitable<Result<std::optional<std::string>>> CsvStream::next() {
  auto slice = [this](SQLite::Database& database) { return writer_.next(database); };
  co_return co_await exports_.reader().ask(std::move(slice));
}

ExportFile::ExportFile(const std::filesystem::path& folder, const std::string& ending) {
  std::filesystem::create_directories(folder);
  std::string name = (folder / ("export-XXXXXX" + ending)).string();
  const int file = ::mkstemps(name.data(), static_cast<int>(ending.size()));
  if (file < 0) throw std::system_error{errno, std::generic_category(), "cannot create a file in " + folder.string()};
  ::close(file);
  path_ = name;
}

ExportFile::~ExportFile() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

asio::awaitable<Result<ExportFilePtr>> begin_export_file(ExportRoutes parts, std::vector<storage::RecordedSpan> spans,
                                                         std::uint64_t rows_per_sample, std::string ending) {
  if (auto may = parts.disk_watch.may_begin("an export to a file"); !may) {
    co_return std::unexpected{may.error()};
  }
  auto job = [folder = parts.folder, ending, spans = std::move(spans), rows_per_sample](SQLite::Database& database) {
    return make_file(folder, ending, most_samples(database, spans) * rows_per_sample);
  };
  auto file = co_await parts.history.reader().ask(std::move(job));
  if (!file) co_return std::unexpected{file.error()};
  co_return ExportFilePtr{file->release(), EndOnWorker{parts.tasks, parts.history.reader()}};
}

asio::awaitable<Result<std::optional<std::string>>> FileStream::next() {
  auto job = [path = file_->path(), offset = sent_bytes_] { return read_piece(path, offset); };
  std::string piece = co_await exports_.reader().run(std::move(job));
  sent_bytes_ += piece.size();
  if (piece.empty()) co_return std::optional<std::string>{};
  co_return std::optional{std::move(piece)};
}

}  // namespace server::api
