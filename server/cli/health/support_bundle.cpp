// Gathers each file as text, and writes them all into one archive.
#include "server/cli/health/support_bundle.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>
#include <fmt/ostream.h>
#include <openssl/crypto.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <sys/utsname.h>

#include <CLI/CLI.hpp>
#include <boost/asio/io_context.hpp>
#include <cstdio>
#include <deque>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>

#include "base/version.hpp"
#include "base/whole_file.hpp"
#include "server/analysis/capsule/archive_writer.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/health/doctor.hpp"
#include "server/cli/health/redaction.hpp"
#include "server/cli/health/running_station.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/storage/database/finished_file.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::cli {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr std::size_t kMostLogLines = 5000, kMostLogBytes = 8 << 20;
constexpr std::int64_t kMicrosecondsADay = 86'400'000'000;
constexpr const char* kJournal = "journalctl -u rheonaut -n 5000 --no-pager -o short-iso-precise 2>/dev/null";
constexpr const char* kAbout =
    "A support bundle of a Rheonaut station, made by `rheonaut support-bundle`.\n\n"
    "Secrets are removed: tokens, passwords, keys, hashes, and hosts, users and queries of addresses. Look through "
    "the\n"
    "files before you pass them on: names of robots and runs, addresses of peers in events and the log, and paths are\n"
    "in them. doctor.txt is the file to read first.\n";

std::int64_t utc_now_us() {
  boost::asio::io_context loop;
  return runtime::SystemClock{loop}.utc_us();
}

std::string first_line_of(const fs::path& file) {
  constexpr std::size_t kMaxBytes = 64 * 1024;
  std::ifstream in{file};
  return base::read_line(in, kMaxBytes).text;
}

Redaction redaction_for(const config::Config& config) {
  Redaction redaction;
  redaction.add_secret(first_line_of(config.data_dir / "rheonaut.token"));
  for (const std::string& host : config.http_hosts) redaction.add_secret(host);
  return redaction;
}

// What is wrong stands in the file instead of it.
std::string or_reason(const std::function<std::string()>& gather) {
  try {
    return gather();
  } catch (const std::exception& error) {
    return fmt::format("not gathered: {}\n", one_line(runtime::text_of(error)));
  }
}

std::string versions_json(const config::Config& config) {
  utsname system{};
  uname(&system);
  std::string distribution = "unknown";
  std::ifstream in{"/etc/os-release"};
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("PRETTY_NAME=")) distribution = line.substr(line.find('=') + 1);
  }
  ordered_json versions{{"rheonaut", base::version()},
                        {"sqlite", sqlite3_libversion()},
                        {"openssl", OpenSSL_version(OPENSSL_VERSION)},
                        {"compiler", __VERSION__},
                        {"system", fmt::format("{} {} {}", system.sysname, system.release, system.machine)},
                        {"distribution", distribution}};
  const auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    versions["schema"] = database.execAndGet("PRAGMA user_version").getInt64();
    return {};
  };
  static_cast<void>(storage::read_store(config.database(), read));
  return versions.dump(1) + '\n';
}

// Numbers and words only: names of hosts are counted, and of keys it is said whether they are named.
std::string config_json(const config::Config& config) {
  ordered_json out{{"data.dir", config.data_dir.string()},
                   {"http.listen", config.http},
                   {"http.hosts", fmt::format("{} names", config.http_hosts.size())},
                   {"http.max_connections", config.http_places.connections},
                   {"http.max_connections_per_address", config.http_places.of_address},
                   {"robots.listen", config.robots},
                   {"robots.max_connections", config.robot_places.connections},
                   {"robots.max_connections_per_address", config.robot_places.of_address},
                   {"robots.link_timeout_ms", config.link.link_timeout_ms},
                   {"robots.heartbeat_interval_ms", config.link.heartbeat_interval_ms},
                   {"robots.samples_per_frame", config.link.samples_per_frame},
                   {"recording.retention_days", config.recording.retention_days},
                   {"recording.event_retention_days", config.recording.event_retention_days},
                   {"recording.give_up_after_days", config.recording.give_up_after_days},
                   {"recording.max_database_mb", config.recording.max_database_mb},
                   {"recording.low_space_mb", config.recording.low_space_mb},
                   {"recording.critical_space_mb", config.recording.critical_space_mb},
                   {"recording.backup_dir", config.recording.backup_dir.empty() ? "default" : "set"},
                   {"tls.mode", text(config.tls.mode)},
                   {"tls.certificate", config.tls.certificate.empty() ? "default" : "set"},
                   {"tls.key", config.tls.key.empty() ? "default" : "set"},
                   {"tls.insecure", config.tls.insecure},
                   {"experiments.allow_unattended", config.experiments.allow_unattended},
                   {"experiments.back_within_s", config.experiments.back_within_s},
                   {"foxglove.enabled", config.foxglove},
                   {"station.real_time", config.real_time},
                   {"log.level", config.log_level},
                   {"log.format", config.log_format}};
  return out.dump(1) + '\n';
}

std::string metrics_of(const config::Config& config) {
  const RunningStation running = look_for_station(config.data_dir);
  if (!running.answers) return "no station runs, or it does not answer\n";
  return StationClient{config.data_dir}.ask("GET", "/metrics").text;
}

std::string rows_of(const config::Config& config, const std::function<std::string(SQLite::Database&)>& gather) {
  std::string text;
  const auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    text = gather(database);
    return {};
  };
  const auto done = storage::read_store(config.database(), read);
  return done ? text : fmt::format("not gathered: {}\n", one_line(done.error().detail));
}

std::string schema_of(SQLite::Database& database) {
  std::string text;
  SQLite::Statement query{database, "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY rowid"};
  while (query.executeStep()) text += query.getColumn(0).getString() + ";\n";
  return text;
}

// Counting millions of rows would hold the write-ahead log of a station that records: beyond a limit, the largest
// rowid.
std::int64_t about_how_many(SQLite::Database& database, const std::string& table) {
  constexpr std::int64_t kMostCounted = 100'000;
  const std::int64_t counted =
      database.execAndGet(fmt::format("SELECT count(*) FROM (SELECT 1 FROM \"{}\" LIMIT {})", table, kMostCounted + 1))
          .getInt64();
  if (counted <= kMostCounted) return counted;
  try {
    return database.execAndGet(fmt::format("SELECT max(rowid) FROM \"{}\"", table)).getInt64();
  } catch (const SQLite::Exception&) {
    return counted;  // a table without rowid: it has at least these
  }
}

std::string table_counts(SQLite::Database& database) {
  ordered_json counts = ordered_json::object();
  SQLite::Statement tables{database, "SELECT name FROM sqlite_schema WHERE type = 'table' ORDER BY name"};
  while (tables.executeStep()) {
    const std::string name = tables.getColumn(0).getString();
    counts[name] = about_how_many(database, name);
  }
  return counts.dump(1) + '\n';
}

std::string parameters_of_robots(SQLite::Database& database, const Redaction& redaction) {
  SQLite::Statement query{database,
                          "SELECT boot.robot_id, max(in_force.noticed_at_us), document.content FROM in_force JOIN "
                          "document USING (document_key) JOIN boot USING (boot_key) WHERE in_force.kind = 'parameters' "
                          "GROUP BY boot.robot_id"};
  ordered_json robots = ordered_json::object();
  while (query.executeStep()) {
    const std::string content = redaction.of_own(query.getColumn(2).getString());
    robots[redaction.of(query.getColumn(0).getString())] = {
        {"noticed_at_us", query.getColumn(1).getInt64()}, {"parameters", ordered_json::parse(content, nullptr, false)}};
  }
  return robots.dump(1, ' ', false, ordered_json::error_handler_t::replace) + '\n';
}

std::string events_of_last_day(SQLite::Database& database, const Redaction& redaction) {
  SQLite::Statement query{database,
                          "SELECT received_at_us, robot_id, kind, cause, mode, detail FROM event WHERE "
                          "event_row > (SELECT coalesce(max(event_row), 0) - 20000 FROM event) AND received_at_us > ? "
                          "ORDER BY event_row DESC"};
  query.bind(1, utc_now_us() - kMicrosecondsADay);
  std::string text;
  while (query.executeStep()) {
    ordered_json event{{"received_at_us", query.getColumn(0).getInt64()}};
    const char* names[]{"robot_id", "kind", "cause", "mode", "detail"};
    for (int column = 1; column <= 5; ++column) {
      event[names[column - 1]] = redaction.of(query.getColumn(column).getString());
    }
    text += event.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + '\n';
  }
  return text;
}

std::string log_lines(const SupportBundle& options) {
  std::string text;
  if (options.log) {
    std::error_code unknown;
    const std::uintmax_t bytes = fs::file_size(*options.log, unknown);  // of a regular file alone
    std::ifstream in{unknown ? fs::path{} : *options.log, std::ios::binary};
    if (!in) return fmt::format("{} cannot be read\n", options.log->string());
    if (bytes > kMostLogBytes) in.seekg(static_cast<std::streamoff>(bytes - kMostLogBytes));
    std::istringstream newest{base::read_whole(in, 2 * kMostLogBytes).text};  // it may grow meanwhile
    std::deque<std::string> last;
    for (std::string line; std::getline(newest, line);) {
      last.push_back(std::move(line));
      if (last.size() > kMostLogLines) last.pop_front();
    }
    for (const std::string& line : last) text += line + '\n';
    return text;
  }
  const std::unique_ptr<FILE, int (*)(FILE*)> journal{popen(kJournal, "r"), pclose};
  std::array<char, 4096> piece{};
  while (journal && std::fgets(piece.data(), piece.size(), journal.get()) != nullptr) {
    text += piece.data();
    if (text.size() > 2 * kMostLogBytes) text.erase(0, kMostLogBytes);
  }
  return text.empty() ? "there is no journal of a unit rheonaut; give its log with --log FILE\n" : text;
}

}  // namespace

void add_options(CLI::App& command, SupportBundle& options) {
  command.add_option("--data", options.flags.data_dir, "Folder of the station (default: rheonaut-data)")
      ->check(named());
  command.add_option("--config", options.flags.file, "Configuration that the station is started with")->check(named());
  command.add_option("--to", options.to, "The zip file to write; one that is there is replaced")
      ->check(named())
      ->required();
  command.add_option("--log", options.log, "File with the station's log (default: the journal of the unit rheonaut)")
      ->check(named());
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut support-bundle --data ~/lab --to bundle.zip");
}

int run(const SupportBundle& options, std::ostream& out) {
  umask(077);
  const config::Config config = load_config(options.flags);
  const Redaction redaction = redaction_for(config);
  const Findings findings = examine(options.flags);
  std::ostringstream doctor;
  write_findings(doctor, findings);

  const storage::Draft part{fs::path{options.to}.concat(".part")};
  analysis::ArchiveWriter archive{part.path(), utc_now_us()};
  const auto add = [&archive](const std::string& name, const std::string& text) {
    archive.begin("rheonaut-support/" + name);
    archive.add(text);
    archive.end();
  };
  const auto add_rows = [&](const std::string& name, const std::function<std::string(SQLite::Database&)>& gather) {
    add(name, or_reason([&] { return rows_of(config, gather); }));
  };
  add("README.txt", kAbout);
  add("doctor.txt", redaction.of_own(doctor.view()));
  add("doctor.json", redaction.of_own(json_of(findings).dump(1)) + '\n');
  add("versions.json", or_reason([&] { return versions_json(config); }));
  add("config.json", redaction.of_own(config_json(config)));
  add("metrics.txt", redaction.of(or_reason([&] { return metrics_of(config); })));
  add_rows("schema.sql", schema_of);
  add_rows("tables.json", table_counts);
  add_rows("parameters.json", [&](SQLite::Database& database) { return parameters_of_robots(database, redaction); });
  add_rows("events.jsonl", [&](SQLite::Database& database) { return events_of_last_day(database, redaction); });
  add("log.txt", redaction.of(or_reason([&] { return log_lines(options); })));
  archive.close();
  while (archive.seal()) {
  }
  storage::finish_file(part.path(), options.to);
  if (options.form.is_json) {
    write_json(
        out,
        {{"file", options.to.string()}, {"size_bytes", fs::file_size(options.to)}, {"problems", findings.problems()}});
    return 0;
  }
  fmt::print(out, "{}: look through it before you pass it on; doctor.txt says: {}\n", options.to.string(),
             findings.problems() == 0 ? "nothing is wrong" : fmt::format("{} problems", findings.problems()));
  return 0;
}

}  // namespace server::cli
