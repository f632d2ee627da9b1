// Bytes that are hashed, and the two statements that append.
#include "server/storage/audit/audit_chain.hpp"

#include <fmt/format.h>
#include <sodium.h>
#include <sqlite3.h>

#include <algorithm>
#include <charconv>
#include <initializer_list>
#include <string_view>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::string_view kFormat = "rheonaut-audit-1\n";

class Hashing {
 public:
  Hashing() { crypto_generichash_init(&state_, nullptr, 0, AuditHash{}.size()); }

  void add(const void* bytes, std::size_t size) {
    crypto_generichash_update(&state_, static_cast<const unsigned char*>(bytes), size);
  }
  void add(std::int64_t number) {
    std::array<unsigned char, 8> bytes{};
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<unsigned char>(static_cast<std::uint64_t>(number) >> (8 * i));
    }
    add(bytes.data(), bytes.size());
  }
  void add(std::string_view text) {
    add(static_cast<std::int64_t>(text.size()));
    add(text.data(), text.size());
  }
  AuditHash finish() {
    AuditHash hash{};
    crypto_generichash_final(&state_, hash.data(), hash.size());
    return hash;
  }

 private:
  crypto_generichash_state state_{};
};

template <class Bytes>
bool read_bytes(const SQLite::Column& column, Bytes& bytes) {
  if (!column.isBlob() || static_cast<std::size_t>(column.getBytes()) != bytes.size()) return false;
  std::copy_n(static_cast<const unsigned char*>(column.getBlob()), bytes.size(), bytes.begin());
  return true;
}

template <class Bytes>
void bind_bytes(SQLite::Statement& statement, int index, const Bytes& bytes) {
  statement.bind(index, bytes.data(), static_cast<int>(bytes.size()));
}

AuditHead read_head(SQLite::Statement& query) {
  AuditHead head;
  query.tryReset();
  if (!query.executeStep()) return head;
  head.entry = query.getColumn(0).getInt64();
  if (!read_bytes(query.getColumn(1), head.hash)) {
    throw SQLite::Exception{fmt::format("entry {} of the audit has no hash", head.entry), SQLITE_CORRUPT};
  }
  return head;
}

constexpr const char* kSelectHead = "SELECT entry, hash FROM audit ORDER BY entry DESC LIMIT 1";

}  // namespace

std::string text(const AuditHash& hash) {
  std::string hex;
  for (const unsigned char byte : hash) hex += fmt::format("{:02x}", byte);
  return hex;
}

std::string text(const AuditHead& head) { return fmt::format("{}:{}", head.entry, text(head.hash)); }

Result<AuditHead> parse_audit_head(const std::string& text) {
  AuditHead head;
  const auto colon = text.find(':');
  const char* const end = text.data() + std::min(colon, text.size());
  const bool has_entry = std::from_chars(text.data(), end, head.entry) == std::from_chars_result{end, std::errc{}};
  const std::string hex = colon == std::string::npos ? "" : text.substr(colon + 1);
  std::size_t bytes = 0;
  const char* stopped = nullptr;
  const bool has_hash =
      sodium_hex2bin(head.hash.data(), head.hash.size(), hex.data(), hex.size(), nullptr, &bytes, &stopped) == 0 &&
      bytes == head.hash.size() && stopped == hex.data() + hex.size();
  if (has_entry && head.entry > 0 && has_hash) return head;
  return fail(ErrorCode::invalid,
              fmt::format("'{}' is not ENTRY:HASH with an entry from 1 and 64 hexadecimal digits, as the station's log "
                          "and rheonaut verify --audit say it",
                          text.substr(0, 100)));
}

AuditHash content_hash_of(const station::AuditNote& note, const AuditSalt& salt) {
  Hashing hashing;
  hashing.add(kFormat.data(), kFormat.size());
  hashing.add(salt.data(), salt.size());
  hashing.add(note.by.at_us);
  for (const std::string* each :
       {&note.by.actor, &note.by.peer, &note.robot_id, &note.action, &note.subject, &note.detail}) {
    hashing.add(std::string_view{*each});
  }
  return hashing.finish();
}

AuditHash link_hash_of(const AuditHash& before, std::int64_t entry, const AuditHash& content_hash) {
  Hashing hashing;
  hashing.add(before.data(), before.size());
  hashing.add(entry);
  hashing.add(content_hash.data(), content_hash.size());
  return hashing.finish();
}

std::optional<AuditEntry> audit_entry_from(SQLite::Statement& row) {
  AuditEntry read;
  read.entry = row.getColumn(0).getInt64();
  if (!row.getColumn(1).isInteger()) return std::nullopt;
  read.note.by.at_us = row.getColumn(1).getInt64();
  int column = 2;
  for (std::string* each : {&read.note.by.actor, &read.note.by.peer, &read.note.robot_id, &read.note.action,
                            &read.note.subject, &read.note.detail}) {
    if (!row.getColumn(column).isText()) return std::nullopt;
    *each = row.getColumn(column++).getString();
  }
  const bool has_bytes = read_bytes(row.getColumn(column), read.salt) &&
                         read_bytes(row.getColumn(column + 1), read.content_hash) &&
                         read_bytes(row.getColumn(column + 2), read.hash);
  return has_bytes ? std::optional{std::move(read)} : std::nullopt;
}

AuditHead audit_head(SQLite::Database& database) {
  SQLite::Statement query{database, kSelectHead};
  return read_head(query);
}

AuditChain::AuditChain(SQLite::Database& database)
    : head_{database, kSelectHead},
      insert_{database, fmt::format("INSERT INTO audit ({}) VALUES (?,?,?,?,?,?,?,?,?,?,?)", kAuditColumns)} {}

std::int64_t AuditChain::append(const station::AuditNote& note) {
  const AuditHead before = read_head(head_);
  head_.reset();
  const std::int64_t entry = before.entry + 1;
  AuditSalt salt{};
  randombytes_buf(salt.data(), salt.size());
  const AuditHash content_hash = content_hash_of(note, salt);
  bind_all(insert_, entry, note.by.at_us, note.by.actor, note.by.peer, note.robot_id, note.action, note.subject,
           note.detail);
  bind_bytes(insert_, 9, salt);
  bind_bytes(insert_, 10, content_hash);
  bind_bytes(insert_, 11, link_hash_of(before.hash, entry, content_hash));
  insert_.exec();
  insert_.reset();
  return entry;
}

AuditHead append_audit(SQLite::Database& database, const station::AuditNote& note) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  AuditChain{database}.append(note);
  transaction.commit();
  return audit_head(database);
}

}  // namespace server::storage
