// An open file keeps its bytes.
#include "server/api/analysis/job_file_stream.hpp"

namespace server::api {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kPieceOfJobFile = 256 * 1024;

}  // namespace

asio::awaitable<std::unique_ptr<JobFileStream>> JobFileStream::open(storage::DatabaseReader& reader,
                                                                    storage::JobFile file) {
  auto open = [path = std::move(file.path)] { return std::make_shared<std::ifstream>(path, std::ios::binary); };
  auto opened = co_await reader.run(std::move(open));
  if (!*opened) co_return nullptr;
  co_return std::make_unique<JobFileStream>(reader, std::move(opened));
}

asio::awaitable<Result<std::optional<std::string>>> JobFileStream::next() {
  auto read = [file = file_] {
    std::string piece(kPieceOfJobFile, '\0');
    file->read(piece.data(), static_cast<std::streamsize>(piece.size()));
    piece.resize(static_cast<std::size_t>(file->gcount()));
    return piece;
  };
  std::string piece = co_await reader_.run(std::move(read));
  if (piece.empty()) co_return std::optional<std::string>{};
  co_return std::optional{std::move(piece)};
}

}  // namespace server::api
