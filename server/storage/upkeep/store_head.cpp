// JSON, and a comparison.
#include "server/storage/upkeep/store_head.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <charconv>
#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"
#include "server/runtime/secrets.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::size_t kMaxFileBytes = 64 * 1024;

std::string utc_text(std::int64_t at_us) {
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(static_cast<std::time_t>(at_us / 1'000'000)));
}

// "42:9f86d081", enough for people.
std::string short_text(const AuditHead& head) {
  constexpr std::size_t kHashDigits = 8;
  const std::string all = text(head);
  return all.substr(0, all.find(':') + 1 + kHashDigits);
}

// Throws std::exception when it is not such a file.
HeadFile parse(const std::string& text) {
  const json object = json::parse(text);
  HeadFile file;
  const auto& id = object.at("store_id").get_ref<const std::string&>();
  const auto parsed = std::from_chars(id.data(), id.data() + id.size(), file.head.store_id);
  if (parsed.ec != std::errc{} || parsed.ptr != id.data() + id.size())
    throw std::runtime_error{"store_id is no number"};
  file.head.commits = object.at("commits").get<std::int64_t>();
  if (const json& head = object.at("audit_head"); !head.is_null()) {
    const auto audit = parse_audit_head(head.get<std::string>());
    if (!audit) throw std::runtime_error{audit.error().detail};
    file.head.audit = *audit;
  }
  file.at_us = object.at("at_us").get<std::int64_t>();
  for (const json& loss : object.at("losses")) {
    file.losses.push_back({loss.at("noticed_at_us").get<std::int64_t>(), loss.at("problem").get<std::string>()});
  }
  return file;
}

// The hash of an entry of the audit; all zero when it is not there.
AuditHash hash_of_entry(SQLite::Database& database, std::int64_t entry) {
  SQLite::Statement query{database, "SELECT hash FROM audit WHERE entry = ?"};
  bind_all(query, entry);
  AuditHash hash{};
  if (!query.executeStep()) return hash;
  const SQLite::Column column = query.getColumn(0);
  if (!column.isBlob() || static_cast<std::size_t>(column.getBytes()) != hash.size()) return hash;
  std::copy_n(static_cast<const unsigned char*>(column.getBlob()), hash.size(), hash.begin());
  return hash;
}

std::unexpected<Error> unusable(const fs::path& head, const fs::path& database, const std::string& why) {
  return fail(ErrorCode::invalid, fmt::format("{} cannot be used ({}): whether {} has lost commits cannot be told",
                                              head.string(), why, database.filename().string()));
}

}  // namespace

fs::path head_file_of(const fs::path& database) { return fs::path{database}.replace_extension(".head.json"); }

Result<std::optional<HeadFile>> load_head_file(const fs::path& database) {
  const fs::path path = head_file_of(database);
  std::error_code status_error;
  if (fs::status(path, status_error).type() == fs::file_type::not_found) return std::nullopt;
  try {
    if (is_symlink(path)) throw std::runtime_error{"it is a link, which could lead to a file of somebody else"};
    if (!is_regular_file(path)) throw std::runtime_error{"it is no file"};  // a pipe would be waited for
    const base::WholeFile whole = base::read_whole(path, kMaxFileBytes);
    if (whole.error != 0) throw std::runtime_error{runtime::denial(path, whole.error)};
    if (!whole.problem.empty()) throw std::runtime_error{"it " + whole.problem};
    return parse(whole.text);
  } catch (const json::exception&) {  // its words quote the file, whatever that holds
    return unusable(path, database, "it is not as the station writes it");
  } catch (const std::exception& error) {
    return unusable(path, database, runtime::text_of(error));
  }
}

void save_head_file(const fs::path& database, const HeadFile& file) {
  json losses = json::array();
  for (const StoreLoss& loss : file.losses) {
    losses.push_back({{"noticed_at_us", loss.noticed_at_us}, {"problem", loss.problem}});
  }
  const AuditHead& audit = file.head.audit;
  const nlohmann::ordered_json object{{"store_id", std::to_string(file.head.store_id)},
                                      {"commits", file.head.commits},
                                      {"audit_head", audit.entry == 0 ? json(nullptr) : json(text(audit))},
                                      {"at_us", file.at_us},
                                      {"losses", std::move(losses)}};
  runtime::write_private(head_file_of(database), object.dump() + '\n');
}

StoreHead read_store_head(SQLite::Database& database) {
  const SQLite::Transaction moment{database};
  SQLite::Statement query{database, "SELECT name, value FROM meta WHERE name IN ('store_id', 'commits')"};
  StoreHead head;
  while (query.executeStep()) {
    const bool is_id = query.getColumn(0).getString() == "store_id";
    is_id ? static_cast<void>(head.store_id = unsigned_id(query.getColumn(1)))
          : static_cast<void>(head.commits = query.getColumn(1).getInt64());
  }
  head.audit = audit_head(database);
  return head;
}

std::optional<std::string> find_loss(SQLite::Database& database, const HeadFile& file) {
  const StoreHead& before = file.head;
  const StoreHead now = read_store_head(database);
  if (now.store_id != before.store_id) {
    return fmt::format(
        "the database is another one than at {}: store {} with {} commits and {} entries of the audit was here, store "
        "{} is here now. The file or its write-ahead log was removed, or another file was put in its place",
        utc_text(file.at_us), before.store_id, before.commits, before.audit.entry, now.store_id);
  }
  const bool has_entry =
      before.audit.entry == 0 || runtime::same(hash_of_entry(database, before.audit.entry), before.audit.hash);
  if (now.commits >= before.commits && has_entry) return std::nullopt;
  return fmt::format(
      "the database has lost commits: at {} it held {} and the audit ended with entry {}, now there are {} and {}. The "
      "write-ahead log was removed or cut, or an older copy was put in its place",
      utc_text(file.at_us), before.commits, short_text(before.audit), now.commits, short_text(now.audit));
}

}  // namespace server::storage
