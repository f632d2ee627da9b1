// By SQL on a read-only handle.
#include "server/cli/health/store_checks.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sqlite3.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <map>

#include "server/cli/terminal/output.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"
#include "server/storage/database/file_check.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/upkeep/store_head.hpp"

namespace server::cli {
namespace fs = std::filesystem;

namespace {

constexpr std::int64_t kCheckUs = 5'000'000;
constexpr int kStepsBetweenLooks = 10'000;  // of SQLite's virtual machine
constexpr std::int64_t kRefusalsUs = 86'400'000'000;
constexpr const char* kReadAgain =
    "end the program that holds it, look at the rights of the file and at the disk, and ask again";
constexpr const char* kVerify = "stop the station, then rheonaut verify, and restore a backup if it finds damage";

std::int64_t newest_version() { return static_cast<std::int64_t>(storage::migrations().size()); }

struct Deadline {
  boost::asio::io_context loop;
  runtime::SystemClock clock{loop};
  std::int64_t at_us = clock.steady_us() + kCheckUs;
};

int is_late(void* deadline) {
  const auto* until = static_cast<const Deadline*>(deadline);
  return until->clock.steady_us() > until->at_us ? 1 : 0;
}

// Empty: none found; nothing: it was not finished in time.
std::optional<std::string> damage_found_in_time(SQLite::Database& database) {
  Deadline deadline;
  sqlite3_progress_handler(database.getHandle(), kStepsBetweenLooks, is_late, &deadline);
  std::optional<std::string> damage;
  try {
    const std::string said = database.execAndGet("PRAGMA quick_check(1)").getString();
    damage = said == "ok" ? "" : said;
  } catch (const SQLite::Exception& error) {
    if (storage::means_damage(error)) {
      damage = runtime::text_of(error);
    } else if (error.getErrorCode() != SQLITE_INTERRUPT) {
      throw;
    }
  }
  sqlite3_progress_handler(database.getHandle(), 0, nullptr, nullptr);
  return damage;
}

std::int64_t latest_time(SQLite::Database& database) {
  return database
      .execAndGet(
          "SELECT max(coalesce((SELECT at_us FROM audit ORDER BY entry DESC LIMIT 1), 0), "
          "coalesce((SELECT max(connected_at_us) FROM boot), 0))")
      .getInt64();
}

void check_losses(const fs::path& path, Findings& findings) {
  const auto head = storage::load_head_file(path);
  if (!head) return findings.problem("database", one_line(head.error().detail), kVerify);
  if (!*head || (*head)->losses.empty()) return;
  findings.problem("database", "the database has lost commits: " + one_line((*head)->losses.front().problem),
                   "docs/operations.md, \"The database has lost commits\"");
}

std::int64_t check_pages(SQLite::Database& database, const fs::path& path, Findings& findings) {
  const auto version = database.execAndGet("PRAGMA user_version").getInt64();
  const std::optional<std::string> damage = damage_found_in_time(database);
  const std::string size = fmt::format("{:.1f} MB, schema {}", static_cast<double>(fs::file_size(path)) / 1e6, version);
  if (damage && !damage->empty()) {
    findings.problem("database", fmt::format("{} is damaged: {}", path.string(), one_line(*damage)), kVerify);
    return 0;
  }
  if (!damage) {
    findings.note(
        "database",
        fmt::format("{}; its pages were checked for {} s, which was not enough for all", size, kCheckUs / 1'000'000),
        "rheonaut verify checks everything");
  } else if (version < newest_version()) {
    findings.note("database", fmt::format("{}; this program uses schema {}", size, newest_version()),
                  "nothing: the next start brings it up to date, and keeps a copy");
  } else {
    findings.fine("database", size + ", its pages are whole");
  }
  return version < newest_version() ? 0 : latest_time(database);
}

// What stands against each cause of a refusal of the robot's Hello.
const char* remedy_of(const std::string& cause, int count) {
  if (cause == "version") return "flash the robot with the firmware that belongs to this station (docs/robot.md)";
  if (cause == "unknown_robot") return "rheonaut robot enrol ID, and its token into the robot";
  if (cause == "wrong_token") {
    return "put the token with which it was enrolled back into the robot; only where nobody has it any more: rheonaut "
           "robot revoke ID, which gives up the samples that the robot has not sent yet, then rheonaut robot enrol ID, "
           "and the new token into the robot";
  }
  if (cause == "already_connected") {
    return count == 1
               ? "nothing: a robot that was reset is refused until its old connection has ended. If it comes again "
                 "without a reset, two robots have one name"
               : "if the robot was not reset as often, two robots have one name: give each its own";
  }
  return "the robot's events say more: GET /api/v1/robots/ID/events";
}

void check_refusals(SQLite::Database& database, std::int64_t now_us, Findings& findings) {
  SQLite::Statement query{database,
                          "SELECT robot_id, cause, count(*), max(detail) FROM event WHERE event_row > "
                          "(SELECT coalesce(max(event_row), 0) - 20000 FROM event) AND kind = 'connection_refused' AND "
                          "received_at_us > ? GROUP BY robot_id, cause LIMIT 10"};
  query.bind(1, now_us - kRefusalsUs);
  while (query.executeStep()) {
    const std::string cause = query.getColumn(1).getString();
    const int count = query.getColumn(2).getInt();
    const std::string what = fmt::format(
        "robot '{}' was refused {} in the last day, {}: {}", one_line(query.getColumn(0).getString()),
        count == 1 ? "once" : fmt::format("{} times", count), cause, one_line(query.getColumn(3).getString()));
    if (cause == "already_connected" && count == 1) {
      findings.note("robots", what, remedy_of(cause, count));
    } else {
      findings.problem("robots", what, remedy_of(cause, count));
    }
  }
}

// By version, the robots whose latest boot has it.
std::map<std::string, std::vector<std::string>> firmware_in_use(SQLite::Database& database) {
  SQLite::Statement query{database,
                          "SELECT boot.firmware_version, boot.robot_id, max(boot.connected_at_us) FROM boot JOIN robot "
                          "USING (robot_id) WHERE boot.connected_at_us IS NOT NULL AND robot.retired_at_us IS NULL AND "
                          "robot.revoked_at_us IS NULL GROUP BY boot.robot_id"};
  std::map<std::string, std::vector<std::string>> robots;
  while (query.executeStep()) {
    robots[one_line(query.getColumn(0).getString())].push_back(one_line(query.getColumn(1).getString()));
  }
  return robots;
}

void judge_firmware(const std::map<std::string, std::vector<std::string>>& robots, Findings& findings) {
  if (robots.size() == 1) return findings.fine("firmware", fmt::format("all robots have {}", robots.begin()->first));
  std::vector<std::string> parts;
  for (const auto& [version, ids] : robots) {
    parts.push_back(fmt::format("{} ({}{})", version, ids.front(),
                                ids.size() == 1 ? "" : fmt::format(" and {} more", ids.size() - 1)));
  }
  findings.note("firmware", fmt::format("robots have different versions: {}", fmt::join(parts, ", ")),
                "flash all with the same, or retire those that are not used: rheonaut robot retire ID");
}

std::size_t connected_in(const nlohmann::json& robot_list) {
  std::size_t count = 0;
  if (!robot_list.is_object()) return 0;
  for (const auto& robot : robot_list.value("robots", nlohmann::json::array())) {
    count += robot.value("link", "") == "connected" ? 1 : 0;
  }
  return count;
}

void judge_robots(std::size_t known, const RunningStation& running, Findings& findings) {
  if (known == 0) {
    const std::string where = running.robots.empty() ? "the station's robots address" : running.robots;
    return findings.note("robots", "no robot has ever connected",
                         fmt::format("try one: rheonaut-sim --station {}; for a real one rheonaut robot enrol ID, and "
                                     "docs/robot.md",
                                     where));
  }
  const std::string in_use = fmt::format("{} robots are in use", known);
  if (!running.robot_list.is_object()) return findings.fine("robots", in_use);
  const std::size_t connected = connected_in(running.robot_list);
  if (connected > 0) return findings.fine("robots", fmt::format("{}, {} are connected", in_use, connected));
  findings.note("robots", in_use + ", and none is connected",
                fmt::format("switch them on; they connect to {}: look at their Wi-Fi, at the firewall, and at their "
                            "station's address",
                            running.robots));
}

}  // namespace

std::int64_t check_database(const fs::path& path, Findings& findings) {
  if (const auto denial = runtime::denied(path, R_OK)) {
    findings.problem("database", one_line(*denial), kReadAgain);
    return 0;
  }
  if (!fs::exists(path)) {
    findings.note("database", fmt::format("there is no {} yet", path.string()), "rheonaut serve makes it");
    return 0;
  }
  if (const auto problem = storage::file_problem(path)) {
    findings.problem("database", one_line(*problem), "docs/operations.md, \"A damaged or foreign file\"");
    return 0;
  }
  check_losses(path, findings);
  std::int64_t latest_us = 0;
  Findings of_pages;
  auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    of_pages = {};  // read again when a station has begun to write meanwhile
    latest_us = check_pages(database, path, of_pages);
    return {};
  };
  const auto done = storage::read_store(path, read);
  findings.append(of_pages);
  if (!done) {
    const bool is_unreadable = done.error().code == ErrorCode::unavailable;  // now; a damaged one is found above
    findings.problem("database", one_line(done.error().detail), is_unreadable ? kReadAgain : kVerify);
  }
  return latest_us;
}

void check_robots(const fs::path& path, const RunningStation& running, std::int64_t now_us, Findings& findings) {
  Findings of_robots;
  auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    of_robots = {};  // read again when a station has begun to write meanwhile
    if (database.execAndGet("PRAGMA user_version").getInt64() < newest_version()) return {};
    const auto firmware = firmware_in_use(database);
    std::size_t known = 0;
    for (const auto& [version, ids] : firmware) known += ids.size();
    judge_robots(known, running, of_robots);
    if (known > 0) judge_firmware(firmware, of_robots);
    check_refusals(database, now_us, of_robots);
    return {};
  };
  std::error_code hidden;
  if (fs::exists(path, hidden))
    static_cast<void>(storage::read_store(path, read));  // check_database has said what is wrong
  findings.append(of_robots);
}

}  // namespace server::cli
