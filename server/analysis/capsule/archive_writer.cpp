// minizip's zip, and the seal behind its end.
#include "server/analysis/capsule/archive_writer.hpp"

#include <fmt/format.h>
#include <zip.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <utility>

namespace server::analysis {
namespace {

constexpr std::size_t kPieceBytes = 1024 * 1024;
constexpr int kLevel = 6;
constexpr int kFirstYear = 1980;  // of a zip archive

tm_zip zip_time(std::int64_t time_us) {
  const auto seconds = static_cast<std::time_t>(time_us / 1'000'000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  tm_zip at{};
  at.tm_sec = static_cast<uInt>(utc.tm_sec / 2 * 2);
  at.tm_min = static_cast<uInt>(utc.tm_min);
  at.tm_hour = static_cast<uInt>(utc.tm_hour);
  at.tm_mday = static_cast<uInt>(utc.tm_mday);
  at.tm_mon = static_cast<uInt>(utc.tm_mon);
  at.tm_year = static_cast<uInt>(std::max(kFirstYear, 1900 + utc.tm_year));
  return at;
}

}  // namespace

PieceHash::PieceHash() { crypto_hash_sha256_init(&state_); }

void PieceHash::add(const char* bytes, std::size_t count) {
  crypto_hash_sha256_update(&state_, reinterpret_cast<const unsigned char*>(bytes), count);
}

std::string PieceHash::text() const {
  crypto_hash_sha256_state state = state_;
  unsigned char hash[crypto_hash_sha256_BYTES];
  crypto_hash_sha256_final(&state, hash);
  std::string hexadecimal;
  for (const unsigned char byte : hash) hexadecimal += fmt::format("{:02x}", byte);
  return hexadecimal;
}

ArchiveWriter::ArchiveWriter(std::filesystem::path path, std::int64_t time_us)
    : path_{std::move(path)}, time_us_{time_us}, zip_{zipOpen64(path_.c_str(), APPEND_STATUS_CREATE)} {
  if (zip_ == nullptr) fail();
}

ArchiveWriter::~ArchiveWriter() {
  if (zip_ != nullptr) zipClose(zip_, nullptr);
}

void ArchiveWriter::fail() const {
  throw std::runtime_error{fmt::format("cannot write {}; is the disk full?", path_.string())};
}

void ArchiveWriter::begin(const std::string& name) {
  zip_fileinfo about{};
  about.tmz_date = zip_time(time_us_);
  entry_ = {name, 0, {}};
  entry_hash_ = {};
  const int opened =
      zipOpenNewFileInZip64(zip_, name.c_str(), &about, nullptr, 0, nullptr, 0, nullptr, Z_DEFLATED, kLevel, 0);
  if (opened != ZIP_OK) fail();
}

void ArchiveWriter::add(const std::string& piece) {
  if (zipWriteInFileInZip(zip_, piece.data(), static_cast<unsigned>(piece.size())) != ZIP_OK) fail();
  entry_.bytes += piece.size();
  entry_hash_.add(piece.data(), piece.size());
}

ArchivedFile ArchiveWriter::end() {
  if (zipCloseFileInZip(zip_) != ZIP_OK) fail();
  entry_.sha256 = entry_hash_.text();
  return entry_;
}

void ArchiveWriter::close() {
  const std::string comment = kSealWords + std::string(kHashDigits, '0');
  if (zipClose(std::exchange(zip_, nullptr), comment.c_str()) != ZIP_OK) fail();
}

bool ArchiveWriter::seal() {
  const std::uint64_t covered = std::filesystem::file_size(path_) - kHashDigits;
  std::fstream file{path_, std::ios::binary | std::ios::in | std::ios::out};
  file.seekg(static_cast<std::streamoff>(sealed_bytes_));
  std::string piece(std::min<std::uint64_t>(kPieceBytes, covered - sealed_bytes_), '\0');
  file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
  if (!file) fail();
  archive_hash_.add(piece.data(), piece.size());
  sealed_bytes_ += piece.size();
  if (sealed_bytes_ < covered) return true;
  file.seekp(static_cast<std::streamoff>(covered));
  if (!(file << archive_hash_.text() << std::flush)) fail();
  return false;
}

}  // namespace server::analysis
