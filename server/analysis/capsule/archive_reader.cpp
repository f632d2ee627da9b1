// minizip's unzip, which checks the CRC of each entry.
#include "server/analysis/capsule/archive_reader.hpp"

#include <fmt/format.h>
#include <unistd.h>
#include <unzip.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <stdexcept>

#include "server/analysis/capsule/archive_writer.hpp"
#include "server/runtime/private_file.hpp"

namespace server::analysis {
namespace {

constexpr std::size_t kArchivePieceBytes = 256 * 1024;
constexpr std::size_t kLongestName = 1000;
constexpr int kCaseSensitive = 1;

std::unexpected<Error> damaged(const std::string& name) {
  return server::fail(ErrorCode::invalid, fmt::format("{} is damaged", name), "damaged");
}

}  // namespace

ArchiveReader::ArchiveReader(std::filesystem::path path) : path_{std::move(path)} {
  if (const auto denial = runtime::denied(path_, R_OK)) {
    throw std::runtime_error{fmt::format("cannot read {}: {}", path_.string(), *denial)};
  }
  if (std::filesystem::is_regular_file(path_)) zip_ = unzOpen64(path_.c_str());  // a fifo would be waited for
  if (zip_ == nullptr) throw std::runtime_error{fmt::format("{} is no zip archive, or damaged", path_.string())};
}

ArchiveReader::~ArchiveReader() { unzClose(zip_); }

std::vector<std::string> ArchiveReader::names() {
  std::vector<std::string> all;
  for (int found = unzGoToFirstFile(zip_); found == UNZ_OK && all.size() <= kMostEntries;
       found = unzGoToNextFile(zip_)) {
    std::string name(kLongestName, '\0');
    unz_file_info64 about{};
    if (unzGetCurrentFileInfo64(zip_, &about, name.data(), name.size(), nullptr, 0, nullptr, 0) != UNZ_OK) break;
    name.resize(std::min<std::size_t>(about.size_filename, name.size()));
    name.shrink_to_fit();
    all.push_back(std::move(name));
  }
  return all;
}

std::string ArchiveReader::fault_of_names() {
  const std::vector<std::string> all = names();
  if (all.size() > kMostEntries) return fmt::format("it has more than {} entries", kMostEntries);
  std::set<std::string> seen;
  for (const std::string& name : all) {
    const bool is_plain =
        std::ranges::none_of(name, [](unsigned char c) { return c < 0x20 || c == 0x7F || c == '\\'; });
    const auto climbs = [](const std::filesystem::path& part) { return part == ".." || part == "/"; };
    const std::filesystem::path path{name};
    if (!is_plain || name.empty() || path.is_absolute() || std::ranges::any_of(path, climbs)) {
      return fmt::format("it has an entry '{}', which is no plain path in it", name);
    }
    if (!seen.insert(name).second) return fmt::format("it has two entries '{}'", name);
  }
  return {};
}

Result<std::string> ArchiveReader::read(const std::string& name,
                                        const std::function<void(const std::string& piece)>& take) {
  if (unzLocateFile(zip_, name.c_str(), kCaseSensitive) != UNZ_OK) {
    return server::fail(ErrorCode::invalid, fmt::format("{} is not in the archive", name), "missing");
  }
  if (unzOpenCurrentFile(zip_) != UNZ_OK) return damaged(name);
  const std::uint64_t most = std::max(kAlwaysAllowedBytes, kMostExpansion * std::filesystem::file_size(path_));
  PieceHash hash;
  std::string piece(kArchivePieceBytes, '\0');
  int got = 0;
  while (unpacked_bytes_ <= most &&
         (got = unzReadCurrentFile(zip_, piece.data(), static_cast<unsigned>(piece.size()))) > 0) {
    const std::string part = piece.substr(0, static_cast<std::size_t>(got));
    hash.add(part.data(), part.size());
    take(part);
    unpacked_bytes_ += part.size();
  }
  if (unpacked_bytes_ > most) {
    unzCloseCurrentFile(zip_);
    return server::fail(ErrorCode::invalid,
                        fmt::format("what is packed, up to {}, is longer than {} bytes, {} times the archive", name,
                                    most, kMostExpansion));
  }
  const int closed = unzCloseCurrentFile(zip_);
  if (got < 0 || closed != UNZ_OK) return damaged(name);
  return hash.text();
}

Result<std::string> ArchiveReader::text(const std::string& name, std::size_t most_bytes) {
  std::string all;
  bool is_too_long = false;
  const auto read_it = read(name, [&](const std::string& piece) {
    is_too_long = is_too_long || all.size() + piece.size() > most_bytes;
    if (!is_too_long) all += piece;
  });
  if (!read_it) return std::unexpected{read_it.error()};
  if (is_too_long) return server::fail(ErrorCode::invalid, fmt::format("{} is longer than {} bytes", name, most_bytes));
  return all;
}

Seal ArchiveReader::seal() const {
  std::ifstream file{path_, std::ios::binary};
  const std::uint64_t bytes = std::filesystem::file_size(path_);
  const std::string words = kSealWords;
  if (bytes < words.size() + kHashDigits) return Seal::none;
  PieceHash hash;
  std::string tail, piece;
  for (std::uint64_t left = bytes - kHashDigits; left > 0; left -= piece.size()) {
    piece.resize(std::min<std::uint64_t>(kArchivePieceBytes, left));
    if (!file.read(piece.data(), static_cast<std::streamsize>(piece.size()))) return Seal::broken;
    hash.add(piece.data(), piece.size());
    tail = (tail + piece).substr(tail.size() + piece.size() - std::min(words.size(), tail.size() + piece.size()));
  }
  std::string digits(kHashDigits, '\0');
  file.read(digits.data(), static_cast<std::streamsize>(digits.size()));
  const bool is_hash = digits.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (tail != words && !is_hash) return Seal::none;
  return tail == words && digits == hash.text() ? Seal::whole : Seal::broken;
}

}  // namespace server::analysis
