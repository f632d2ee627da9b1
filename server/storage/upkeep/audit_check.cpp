// One walk along the chain, one along the commands.
#include "server/storage/upkeep/audit_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

#include "server/runtime/secrets.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/samples/command_store.hpp"
#include "server/storage/samples/stored_rows.hpp"

namespace server::storage {
namespace {

constexpr std::int64_t kPageRows = 1000;
constexpr std::size_t kMostNamed = 20;  // of one kind; the others are counted
constexpr int kFirstContentColumn = 1;  // of kAuditColumns
constexpr int kContentHashColumn = 9;

bool is_hidden(SQLite::Statement& row) {
  for (int column = kFirstContentColumn; column < kContentHashColumn; ++column) {
    if (!row.getColumn(column).isNull()) return false;
  }
  return true;
}

bool read_hash(const SQLite::Column& column, AuditHash& hash) {
  if (!column.isBlob() || static_cast<std::size_t>(column.getBytes()) != hash.size()) return false;
  std::copy_n(static_cast<const unsigned char*>(column.getBlob()), hash.size(), hash.begin());
  return true;
}

// Takes the entries in their order, and says of the first bad one what is wrong.
class ChainWalk {
 public:
  ChainWalk(AuditFindings& findings, const std::optional<AuditHead>& expected, bool is_export)
      : findings_{findings}, expected_{expected}, is_export_{is_export} {}

  // False: it is bad, and reported so. An export begins anywhere in the chain, so its first entry follows from nothing.
  bool take(SQLite::Statement& row) {
    const std::int64_t number = row.getColumn(0).getInt64();
    const std::int64_t before = findings_.head.entry;
    const bool begins_export = is_export_ && findings_.entries == 0 && number > 1;
    if (!begins_export && number != before + 1) {
      return bad(number < 1 ? fmt::format("audit: there is an entry {}", number)
                            : fmt::format("audit: entry {} is missing; entry {} follows on {}", before + 1, number,
                                          before == 0 ? "nothing" : fmt::format("entry {}", before)));
    }
    AuditHash content_hash{};
    AuditHash hash{};
    std::optional<AuditEntry> entry;
    if (is_export_ && is_hidden(row)) {
      if (!read_hash(row.getColumn(kContentHashColumn), content_hash) ||
          !read_hash(row.getColumn(kContentHashColumn + 1), hash)) {
        return bad(fmt::format("audit: entry {} was changed: it has no hashes", number));
      }
      ++findings_.hidden;
    } else {
      entry = audit_entry_from(row);
      if (!entry || !runtime::same(content_hash_of(entry->note, entry->salt), entry->content_hash)) {
        return bad(fmt::format("audit: entry {} was changed: its content is not that of its content_hash", number));
      }
      content_hash = entry->content_hash;
      hash = entry->hash;
    }
    if (!begins_export && !runtime::same(link_hash_of(findings_.head.hash, number, content_hash), hash)) {
      return bad(
          fmt::format("audit: entry {} does not follow on {}: it was moved, exchanged or inserted, or what was "
                      "before it was",
                      number, before == 0 ? "the beginning" : fmt::format("entry {}", before)));
    }
    const bool is_expected = expected_ && expected_->entry == number;
    if (is_expected && !runtime::same(expected_->hash, hash)) {
      return bad(fmt::format("audit: entry {} has the hash {}, not the expected {}: the chain was written anew", number,
                             text(hash), text(expected_->hash)));
    }
    met_expected_ = met_expected_ || is_expected;
    ++findings_.entries;
    findings_.head = {number, hash};
    latest_ = std::move(entry);
    return true;
  }

  // After the last entry.
  void finish() {
    if (!expected_ || met_expected_) return;
    const bool is_beyond = expected_->entry > findings_.head.entry;
    bad(is_beyond ? fmt::format("audit: it ends with entry {}, but entry {} is expected: what came after was removed",
                                findings_.head.entry, expected_->entry)
                  : fmt::format("audit: the expected entry {} is before this part of the audit", expected_->entry));
  }

  const std::optional<AuditEntry>& latest() const { return latest_; }  // empty: it is hidden

 private:
  bool bad(std::string fault) {
    findings_.faults.push_back(std::move(fault));
    return false;
  }

  AuditFindings& findings_;
  const std::optional<AuditHead>& expected_;
  bool is_export_;
  bool met_expected_ = false;
  std::optional<AuditEntry> latest_;
};

// Faults of one kind: the first are named, and all are counted, so that none of another kind is hidden.
class NamedFaults {
 public:
  NamedFaults(AuditFindings& findings, const char* kind) : findings_{findings}, kind_{kind} {}

  void add(std::string fault) {
    if (++count_ <= kMostNamed) findings_.faults.push_back(std::move(fault));
  }
  void finish() {
    if (count_ > kMostNamed) findings_.faults.push_back(fmt::format("and {} more {}", count_ - kMostNamed, kind_));
  }

 private:
  AuditFindings& findings_;
  const char* kind_;
  std::size_t count_ = 0;
};

// It says a state of a command, which the command's row names as its latest: not that a stop was asked for again, or
// that something was refused.
bool is_state_of_command(const station::AuditNote& note) {
  constexpr std::string_view kCommand = "command.";
  if (!note.action.starts_with(kCommand)) return false;
  const std::string_view state = std::string_view{note.action}.substr(kCommand.size());
  for (int value = 0; value <= static_cast<int>(station::kLastCommandState); ++value) {
    if (state == station::text(static_cast<station::CommandState>(value))) return true;
  }
  return false;
}

// Finds an entry about a command which is not there; what the row says is compared from its side.
class CommandLookup {
 public:
  explicit CommandLookup(SQLite::Database& database)
      : row_{database, "SELECT coalesce(audit_entry, 0) FROM command WHERE command_id = ?"} {}

  std::optional<std::string> fault_of(const AuditEntry& entry) {
    if (!is_state_of_command(entry.note)) return std::nullopt;
    const std::string& subject = entry.note.subject;
    std::uint64_t id = 0;
    std::from_chars(subject.data(), subject.data() + subject.size(), id);
    bind_all(row_, id);
    if (!row_.executeStep()) {
      return fmt::format("audit: entry {} tells of command {}, which is not there", entry.entry, id);
    }
    const std::int64_t latest = row_.getColumn(0).getInt64();
    if (latest >= entry.entry) return std::nullopt;
    return fmt::format("command {} names entry {} of the audit, but entry {} tells of it later", id, latest,
                       entry.entry);
  }

 private:
  SQLite::Statement row_;
};

// False: the chain is bad.
bool walk_chain(SQLite::Database& database, ChainWalk& walk, AuditFindings& findings, CommandLookup* commands) {
  NamedFaults faults{findings, "entries that their commands do not name"};
  std::int64_t after = std::numeric_limits<std::int64_t>::min();
  for (std::int64_t read = kPageRows; read == kPageRows;) {
    const SQLite::Transaction moment{database};
    SQLite::Statement rows{database,
                           fmt::format("SELECT {} FROM audit WHERE entry > ? ORDER BY entry LIMIT ?", kAuditColumns)};
    bind_all(rows, after, kPageRows);
    for (read = 0; rows.executeStep(); ++read) {
      after = rows.getColumn(0).getInt64();
      if (!walk.take(rows)) {
        faults.finish();
        return false;
      }
      if (commands == nullptr) continue;
      if (auto fault = commands->fault_of(*walk.latest())) faults.add(std::move(*fault));
    }
  }
  faults.finish();
  walk.finish();
  return true;
}

bool say_the_same(const station::AuditNote& a, const station::AuditNote& b) {
  const auto json = [](const station::AuditNote& note) { return nlohmann::json::parse(note.detail, nullptr, false); };
  return a.by.actor == b.by.actor && a.by.peer == b.by.peer && a.by.at_us == b.by.at_us && a.robot_id == b.robot_id &&
         a.action == b.action && a.subject == b.subject && json(a) == json(b);
}

void check_command(const station::CommandRecord& command, std::int64_t entry, SQLite::Statement& by_entry,
                   AuditFindings& findings, NamedFaults& faults) {
  bind_all(by_entry, entry);
  const auto noted = by_entry.executeStep() ? audit_entry_from(by_entry) : std::nullopt;
  if (!noted) {
    faults.add(fmt::format("command {} names entry {} of the audit, which is not there", command.id, entry));
  } else if (!say_the_same(noted->note, audit_note_of(command))) {
    faults.add(fmt::format("command {} does not say what entry {} of the audit says of it", command.id, entry));
  }
  ++findings.commands;
}

void check_commands(SQLite::Database& database, AuditFindings& findings) {
  NamedFaults faults{findings, "commands that do not say what the audit says"};
  std::int64_t without_entry = 0;
  std::int64_t from = std::numeric_limits<std::int64_t>::min();
  std::int64_t last = from;
  for (std::int64_t read = kPageRows; read == kPageRows;) {
    const SQLite::Transaction moment{database};
    SQLite::Statement by_entry{database, fmt::format("SELECT {} FROM audit WHERE entry = ?", kAuditColumns)};
    SQLite::Statement rows{database, select_commands("WHERE command_id >= ? ORDER BY command_id LIMIT ?")};
    bind_all(rows, from, kPageRows);
    for (read = 0; rows.executeStep(); ++read) {
      last = rows.getColumn(0).getInt64();
      const SQLite::Column entry = rows.getColumn(kCommandAuditEntry);
      const station::CommandRecord command = command_from(rows);
      const bool is_unfinished =
          command.state == station::CommandState::queued || command.state == station::CommandState::sent;
      if (entry.isNull()) {
        without_entry += is_unfinished ? 0 : 1;  // of before the audit: it gets one with its end
      } else {
        check_command(command, entry.getInt64(), by_entry, findings, faults);
      }
    }
    if (last == std::numeric_limits<std::int64_t>::max()) break;
    from = last + 1;
  }
  faults.finish();
  const auto before =
      database.execAndGet("SELECT coalesce(max(value), 0) FROM meta WHERE name = 'commands_before_audit'");
  if (without_entry != before.getInt64()) {
    findings.faults.push_back(fmt::format("{} commands have no entry in the audit, but {} are older than it",
                                          without_entry, before.getInt64()));
  }
}

}  // namespace

AuditFindings check_audit(SQLite::Database& database, const std::optional<AuditHead>& expected) {
  AuditFindings findings;
  ChainWalk walk{findings, expected, false};
  CommandLookup commands{database};
  if (walk_chain(database, walk, findings, &commands)) check_commands(database, findings);
  return findings;
}

AuditFindings check_exported_audit(SQLite::Database& exported, const std::optional<AuditHead>& expected) {
  AuditFindings findings;
  ChainWalk walk{findings, expected, true};
  walk_chain(exported, walk, findings, nullptr);
  return findings;
}

}  // namespace server::storage
