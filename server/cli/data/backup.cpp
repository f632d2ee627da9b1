// Copies by itself when it gets the folder's lock; else the station copies, and the file is moved to its place.
#include "server/cli/data/backup.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <boost/asio/io_context.hpp>
#include <optional>
#include <regex>
#include <stdexcept>
#include <string>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"
#include "server/config/data_folder.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/private_file.hpp"
#include "server/runtime/tasks.hpp"
#include "server/storage/database/backup_copy.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::cli {
namespace fs = std::filesystem;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kLook = 200ms;
constexpr int kAccepted = 202;

void check(const Backup& options) {
  const fs::path database = options.data_dir / "station.sqlite";
  if (!runtime::is_there(database)) throw std::runtime_error{fmt::format("there is no '{}'", database.string())};
  if (runtime::is_there(options.to))
    throw std::runtime_error{fmt::format("'{}' is there already", options.to.string())};
  const fs::path folder = fs::absolute(options.to).parent_path();
  if (!fs::is_directory(folder)) throw std::runtime_error{fmt::format("there is no folder '{}'", folder.string())};
  if (const auto denial = runtime::denied(folder, W_OK | X_OK)) {
    throw std::runtime_error{fmt::format("no backup can be written into '{}': {}", folder.string(), *denial)};
  }
}

// The record of that name, as the station reports it now.
nlohmann::json look(const StationClient& station, const std::string& name, BusyWait& busy) {
  StationAnswer answer = station.ask("GET", "/api/v1/backups");
  while (busy.asks_again(answer)) answer = station.ask("GET", "/api/v1/backups");
  for (const auto& backup : asked(std::move(answer)).value("backups", nlohmann::json::array())) {
    if (backup.at("name") == name) return backup;
  }
  throw std::runtime_error{fmt::format("the station no longer knows backup '{}'", name)};
}

// The station's copies for commands that ended before they had moved them: a day old, for stations of several machines
// may put their copies into one folder.
void remove_abandoned_copies(const StationClient& station, std::int64_t now_s) {
  static const std::regex kOfACommand{"cli-([0-9]{1,12})-[0-9]+"};
  constexpr std::int64_t kDayS = 86'400;
  const StationAnswer answer = station.ask("GET", "/api/v1/backups");
  for (const auto& backup : answer.body.value("backups", nlohmann::json::array())) {
    const auto name = backup.at("name").get<std::string>();
    std::smatch match;
    if (backup.at("state") != "done" || !std::regex_match(name, match, kOfACommand)) continue;
    std::error_code ignored;
    if (now_s - std::stoll(match[1]) > kDayS) fs::remove(backup.at("path").get<std::string>(), ignored);
  }
}

// Where the station has put it.
fs::path let_station_copy(const StationClient& station) {
  boost::asio::io_context loop;
  runtime::SystemClock clock{loop};
  const std::int64_t now_s = clock.utc_us() / 1'000'000;
  remove_abandoned_copies(station, now_s);
  const std::string name = fmt::format("cli-{}-{}", now_s, getpid());
  const StationAnswer begun = station.ask("POST", "/api/v1/backups", {{"name", name}});
  if (begun.status != kAccepted) {
    throw std::runtime_error{fmt::format("the station makes no backup: {}", begun.body.value("detail", "no reason"))};
  }
  BusyWait busy;
  for (;;) {
    const nlohmann::json backup = look(station, name, busy);
    const auto state = backup.at("state").get<std::string>();
    if (state == "done") return backup.at("path").get<std::string>();
    if (state == "failed") {
      throw std::runtime_error{fmt::format("the station made no backup: {}", backup.at("problem").get<std::string>())};
    }
    runtime::run_first(loop, clock.sleep_for(kLook));
  }
}

}  // namespace

void add_options(CLI::App& command, Backup& options) {
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  command.add_option("--to", options.to, "The file to make; there is none of that name yet")
      ->check(named())
      ->required();
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut backup --data ~/lab --to /mnt/other-disk/lab-monday.sqlite");
}

int run(const Backup& options, std::ostream& out) {
  check(options);
  umask(077);
  const Progress progress{"backup: the database is copied and verified", options.form};
  if (const std::optional<config::FolderLock> lock = config::FolderLock::try_take(options.data_dir)) {
    storage::back_up_closed(options.data_dir / "station.sqlite", options.to);
  } else {
    storage::move_finished(let_station_copy(StationClient{options.data_dir}), options.to);
  }
  if (options.form.is_json) {
    write_json(out, {{"file", options.to.string()}, {"size_bytes", fs::file_size(options.to)}, {"verified", true}});
  } else {
    fmt::print(out, "{}: {} bytes, verified\n", options.to.string(), fs::file_size(options.to));
  }
  return 0;
}

}  // namespace server::cli
