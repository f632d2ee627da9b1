// Pieces of bodies, made on the worker.
#include "server/api/routes/csv_export.hpp"

#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <system_error>

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

asio::awaitable<Result<std::optional<std::string>>> FileStream::next() {
  auto job = [path = file_->path(), offset = sent_bytes_] { return read_piece(path, offset); };
  std::string piece = co_await exports_.reader().run(std::move(job));
  sent_bytes_ += piece.size();
  if (piece.empty()) co_return std::optional<std::string>{};
  co_return std::optional{std::move(piece)};
}

}  // namespace server::api
