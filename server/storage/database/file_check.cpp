// Reads the 100 bytes of a database header, the head of its first page and of a rollback journal: the format is
// documented at https://www.sqlite.org/fileformat.html, sections 1.3, 1.6 and 3.
#include "server/storage/database/file_check.hpp"

#include <fmt/format.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <fstream>
#include <string_view>

#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"
#include "server/storage/database/schema.hpp"

namespace server::storage {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kMagic{"SQLite format 3\0", 16};
constexpr std::string_view kJournalMagic{"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 8};
constexpr std::string_view kLogMagic{"\x37\x7f\x06\x82", 4};
constexpr std::string_view kLogMagicBigEndian{"\x37\x7f\x06\x83", 4};  // of its checksums
constexpr std::size_t kHeadBytes = 108;          // the header, and the head of the first page's b-tree
constexpr std::uint64_t kLogHeadBytes = 32;      // a write-ahead log that has no frame
constexpr std::uint64_t kFirstPageBytes = 4096;  // of a database that we make
constexpr std::size_t kMaxSectorBytes = 65'536;  // that a journal may be made for
constexpr char kLeafOfTable = 13;

class Bytes {
 public:
  Bytes(const fs::path& path, std::size_t count) {
    std::ifstream in{path, std::ios::binary};
    if (!in) return;
    bytes_.resize(count);
    in.read(bytes_.data(), static_cast<std::streamsize>(count));
    bytes_.resize(static_cast<std::size_t>(in.gcount()));
  }
  Bytes from(std::size_t offset) const { return Bytes{bytes_.substr(std::min(offset, bytes_.size()))}; }
  std::size_t size() const { return bytes_.size(); }
  bool begins_with(std::string_view mark) const { return bytes_.starts_with(mark); }
  char at(std::size_t offset) const { return bytes_.at(offset); }
  std::uint32_t number(std::size_t offset, std::size_t size) const {  // big-endian
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value = value << 8 | static_cast<unsigned char>(bytes_.at(offset + i));
    return value;
  }

 private:
  explicit Bytes(std::string bytes) : bytes_{std::move(bytes)} {}

  std::string bytes_;
};

std::uint64_t size_or_zero(const fs::path& path) {
  std::error_code absent;
  const auto size = fs::file_size(path, absent);
  return absent ? 0 : size;
}

fs::path beside(const fs::path& path, const char* suffix) { return fs::path{path}.concat(suffix); }

// A write-ahead log with a frame.
bool has_log(const fs::path& path) {
  const Bytes log{beside(path, "-wal"), kLogHeadBytes + 1};
  return log.size() > kLogHeadBytes && (log.begins_with(kLogMagic) || log.begins_with(kLogMagicBigEndian));
}

std::optional<std::uint64_t> page_bytes(const Bytes& head) {
  const std::uint32_t written = head.number(16, 2);
  if (written == 1) return 65'536;
  return written >= 512 && std::has_single_bit(written) ? std::optional<std::uint64_t>{written} : std::nullopt;
}

// No mark of anybody, and no table. Ours is so until its first transaction, and as long as that is in the log only.
bool is_blank(const Bytes& head) {
  return head.number(68, 4) == 0 && head.number(60, 4) == 0 && head.at(100) == kLeafOfTable && head.number(103, 2) == 0;
}

// The power failed while a file was begun: one page at most was written, and by the journal beside it the file was
// empty before, or had that page without a mark or a table. SQLite brings that back.
bool was_just_begun(const fs::path& path) {
  if (size_or_zero(path) > kFirstPageBytes) return false;
  const Bytes journal{beside(path, "-journal"), kMaxSectorBytes + 4 + kHeadBytes};
  if (journal.size() < 28 || !journal.begins_with(kJournalMagic)) return false;
  const std::uint32_t pages_before = journal.number(16, 4), sector = journal.number(20, 4);
  if (pages_before != 1 || sector > kMaxSectorBytes) return pages_before == 0;
  const Bytes record = journal.from(sector), page = journal.from(sector + 4);
  return page.size() >= kHeadBytes && record.number(0, 4) == 1 && page.begins_with(kMagic) && is_blank(page);
}

// A rollback journal that would bring tables back: each has a page of its own beside the first one. Those of our own
// creation are of a file with one page at most.
bool has_hot_journal(const fs::path& path) {
  const Bytes journal{beside(path, "-journal"), 28};
  return journal.size() == 28 && journal.begins_with(kJournalMagic) && journal.number(16, 4) > 1;
}

std::optional<std::string> problem_of_marks(const Bytes& head, const fs::path& path) {
  const std::uint32_t application_id = head.number(68, 4);
  if (is_blank(head)) {
    if (has_hot_journal(path)) return "it has no table, and a journal beside it that is not ours";
    return std::nullopt;
  }
  if (application_id != std::uint32_t{kApplicationId}) {
    return fmt::format("it belongs to another program (application_id {:#x}, Rheonaut's is {:#x})", application_id,
                       kApplicationId);
  }
  const std::uint32_t version = head.number(60, 4);
  if (version >= 1 && version <= migrations().size()) return std::nullopt;
  return fmt::format("its schema is version {}, this program knows 1 to {}; a newer Rheonaut made it", version,
                     migrations().size());
}

// The number of pages is true in a file whose two counters agree.
std::optional<std::string> problem_of_size(const Bytes& head, std::uint64_t page, const fs::path& path) {
  if (head.number(24, 4) != head.number(92, 4)) return {};
  const std::uint64_t expected = head.number(28, 4) * page;
  const std::uint64_t size = size_or_zero(path);
  if (size >= expected) return std::nullopt;
  return fmt::format("it is truncated: {} bytes of {} are there; {}", size, expected, kDamageRemedy);
}

int code_of(const std::exception& error) {
  const auto* const of_sqlite = dynamic_cast<const SQLite::Exception*>(&error);
  return of_sqlite == nullptr ? SQLITE_OK : of_sqlite->getErrorCode();
}

}  // namespace

std::optional<std::string> file_problem(const fs::path& path) {
  if (size_or_zero(path) == 0) {
    return has_hot_journal(path) ? std::optional{"it is empty, and a journal beside it is not ours"} : std::nullopt;
  }
  if (auto denial = runtime::denied(path, R_OK)) return denial;
  const Bytes head{path, kHeadBytes};
  if (head.size() == 0) return "it cannot be read";
  // The power may have failed while the first page was moved out of the log: SQLite reads it from there, and
  // opening the file checks its marks again.
  if (has_log(path) || was_just_begun(path)) return std::nullopt;
  if (!head.begins_with(kMagic)) return "it is not an SQLite database";
  if (head.size() < kHeadBytes) return fmt::format("it is truncated: {} bytes are there", head.size());
  const auto page = page_bytes(head);
  if (!page) return fmt::format("its header is damaged; {}", kDamageRemedy);
  if (auto problem = problem_of_marks(head, path)) return problem;
  return problem_of_size(head, *page, path);
}

std::optional<fs::path> set_aside_orphaned_log(const fs::path& path) {
  if (size_or_zero(path) > 0 || !has_log(path)) return std::nullopt;
  fs::path kept = beside(path, "-wal.orphaned");
  for (int number = 2; fs::exists(kept); ++number) kept = beside(path, "-wal.orphaned-").concat(std::to_string(number));
  fs::rename(beside(path, "-wal"), kept);
  return kept;
}

bool means_damage(const std::exception& error) {
  const int code = code_of(error);
  return code == SQLITE_CORRUPT || code == SQLITE_NOTADB;
}

std::string write_problem(const std::exception& error) {
  if (means_damage(error)) return fmt::format("{}: {}", runtime::text_of(error), kDamageRemedy);
  const char* remedy = "The kernel's log (dmesg) may say more";
  switch (code_of(error)) {
    case SQLITE_FULL: remedy = "Make room on the disk"; break;
    case SQLITE_IOERR:
      remedy = "Make room on the disk; if it has room, the kernel's log (dmesg) says what fails";
      break;
    case SQLITE_BUSY:
    case SQLITE_LOCKED: remedy = "End the program that holds the file"; break;
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN: remedy = "Let the station's user write the file and its folder"; break;
    default: break;
  }
  return fmt::format("{}. {}", runtime::text_of(error), remedy);
}

std::string find_damage(SQLite::Database& database) {
  SQLite::Statement integrity{database, "PRAGMA integrity_check(1)"};
  if (!integrity.executeStep()) return "the integrity check gives no answer";
  std::string found = integrity.getColumn(0).getString();
  if (found != "ok") return found;
  SQLite::Statement references{database, "PRAGMA foreign_key_check"};
  if (!references.executeStep()) return {};
  return fmt::format("a row of {} refers to a row of {} that is not there", references.getColumn(0).getString(),
                     references.getColumn(2).getString());
}

}  // namespace server::storage
