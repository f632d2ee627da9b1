// One subcommand an act.
#include "server/cli/data/reference.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "server/analysis/run_recording.hpp"
#include "server/cli/accounts/author.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"
#include "server/config/data_folder.hpp"
#include "server/runtime/private_file.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::cli {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

using Act = ReferenceCommand::Act;

constexpr int kFirstProblem = 300;

template <class T>
T value_of(Result<T> result) {
  if (!result) throw std::runtime_error{result.error().detail};
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

CLI::App* offer(CLI::App& command, ReferenceCommand& options, Act act, const char* name, const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--run", options.run, "A recorded run by its number")
      ->required()
      ->check(whole(1, std::numeric_limits<storage::RunId>::max()));
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

void add_clock_options(CLI::App& sub, ReferenceCommand& options) {
  auto* offset = sub.add_option("--offset-s", options.offset_s,
                                "Clock: t_s plus this is the time since the first sample of the run's span");
  auto* utc = sub.add_option("--utc-s", options.utc_s, "Clock: UTC (Unix time) of t_s = 0; 0 where t_s is Unix time");
  auto* marker =
      sub.add_option("--marker", options.marker, "Clock: a marker of the run, by number or text, and --at-s");
  auto* at = sub.add_option("--at-s", options.at_s, "The t_s of that marker")->needs(marker);
  marker->needs(at)->check(named());
  auto* sd = sub.add_option("--clock-sd-s", options.clock_sd_s, "How exact that clock is (one sigma)");
  sd->check(non_negative());
  auto* from = sub.add_option("--search-from-s", options.search_from_s, "By correlation: the least offset to look at");
  auto* to = sub.add_option("--search-to-s", options.search_to_s, "By correlation: the largest offset to look at");
  offset->check(finite())->excludes(utc)->excludes(marker);
  utc->check(non_negative())->excludes(marker);
  for (auto* search : {from, to}) {
    search->check(finite())->excludes(offset)->excludes(utc)->excludes(marker)->excludes(sd);
  }
  at->check(finite());
}

std::string text_of_file(const std::string& file) {
  if (runtime::is_there(file) && !fs::is_regular_file(file))
    throw std::runtime_error{fmt::format("cannot read '{}': no file", file)};
  return read_text(file, analysis::kMaxReferenceBytes);
}

analysis::ReferenceClockRequest clock_of(const ReferenceCommand& options) {
  analysis::ReferenceClockRequest clock;
  clock.sd_s = options.clock_sd_s;
  if (options.offset_s) {
    clock.method = storage::ReferenceClock::offset;
    clock.offset_s = *options.offset_s;
  } else if (options.utc_s) {
    clock.method = storage::ReferenceClock::utc;
    clock.zero_at_us = std::llround(*options.utc_s * 1e6);
  } else if (!options.marker.empty()) {
    clock.method = storage::ReferenceClock::marker;
    clock.at_s = options.at_s.value_or(0);
    std::int64_t id = 0;
    const char* end = options.marker.data() + options.marker.size();
    const auto read = std::from_chars(options.marker.data(), end, id);
    if (read.ec == std::errc{} && read.ptr == end) clock.marker_id = id;
    clock.marker_text = options.marker;
  } else {
    if (options.clock_sd_s) throw UsageError{"--clock-sd-s belongs to --offset-s, --utc-s or --marker"};
    clock.search.from_s = options.search_from_s.value_or(clock.search.from_s);
    clock.search.to_s = options.search_to_s.value_or(clock.search.to_s);
  }
  return clock;
}

analysis::ReferenceRequest request_of(const ReferenceCommand& options) {
  analysis::ReferenceRequest request;
  request.csv = text_of_file(options.csv_file);
  request.source = fs::path{options.csv_file}.filename().string();
  request.clock = clock_of(options);
  request.span = options.span;
  request.keeps_zero = options.keeps_zero;
  request.is_in_metres = options.is_in_metres;
  if (options.sd_mm) request.sd_m = *options.sd_mm / 1e3;
  request.reason = options.reason;
  return request;
}

json json_of(const analysis::ReferenceClockRequest& clock) {
  json out{{"method", text(clock.method)}};
  if (clock.sd_s) out["sd_s"] = *clock.sd_s;
  if (clock.method == storage::ReferenceClock::offset) out["offset_s"] = clock.offset_s;
  if (clock.method == storage::ReferenceClock::utc) out["zero_at_us"] = clock.zero_at_us;
  if (clock.method == storage::ReferenceClock::marker) {
    out["at_s"] = clock.at_s;
    clock.marker_id ? out["marker_id"] = *clock.marker_id : out["marker_text"] = clock.marker_text;
  }
  if (std::isfinite(clock.search.from_s)) out["from_s"] = clock.search.from_s;
  if (std::isfinite(clock.search.to_s)) out["to_s"] = clock.search.to_s;
  return out;
}

json json_of(const analysis::ReferenceRequest& request) {
  json out{{"csv", request.csv},
           {"source", request.source},
           {"clock", json_of(request.clock)},
           {"keep_zero", request.keeps_zero},
           {"metres", request.is_in_metres}};
  if (request.span) out["span"] = *request.span;
  if (request.sd_m) out["sd_m"] = *request.sd_m;
  if (!request.reason.empty()) out["reason"] = request.reason;
  return out;
}

json ask_station(const ReferenceCommand& options, const std::string& path, const json& body) {
  const std::string target = fmt::format("/api/v1/runs/{}/reference{}", options.run, path);
  const StationAnswer answer = StationClient{options.data_dir}.ask("POST", target, body, timeout(options.timeout_s));
  if (answer.status < kFirstProblem) return answer.body;
  throw std::runtime_error{answer.body.value("detail", fmt::format("the station answers {}", answer.status))};
}

// In the database, which is closed: nobody else writes.
storage::OutsideReference import_closed(const ReferenceCommand& options, const analysis::ReferenceRequest& request) {
  const fs::path path = options.data_dir / "station.sqlite";
  storage::Database database{path};
  value_of(storage::check_may_import(database.handle(), options.run, request.reason));
  std::optional<storage::MarkerPlace> marker;
  const analysis::ReferenceClockRequest& clock = request.clock;
  if (clock.method == storage::ReferenceClock::marker) {
    marker = value_of(storage::find_marker(database.handle(), options.run, clock.marker_id, clock.marker_text));
  }
  std::vector<analysis::OwnPosition> own;
  for (const storage::StoredSample& stored :
       value_of(storage::read_run(path, options.run, analysis::kMaxAnalysedSamples))) {
    own.push_back(analysis::own_position(stored));
  }
  const std::vector<storage::Zeroing> zeroings = storage::find_zeroings(database.handle(), options.run);
  analysis::PlacedReference placed = value_of(place_reference(request, own, zeroings, marker));
  const station::Author by = command_line_author();
  placed.reference.run = options.run;
  placed.reference.actor = by.actor;
  placed.reference.made_at_us = by.at_us;
  return value_of(store_reference(database.handle(), placed.reference, placed.positions, request.reason, by));
}

storage::StoredReference read_stored(const ReferenceCommand& options, bool with_positions) {
  storage::StoredReference stored;
  auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    auto found = storage::read_reference(database, options.run, {}, with_positions ? analysis::kMaxReferenceRows : 0);
    if (!found) return fail(ErrorCode::not_found, fmt::format("run {} has no reference", options.run));
    stored = std::move(*found);
    return {};
  };
  value_of(storage::read_store(options.data_dir / "station.sqlite", read));
  return stored;
}

void write(const ReferenceCommand& options, const storage::OutsideReference& reference, std::ostream& out) {
  if (options.form.is_json) {
    write_json(out, analysis::json_of(reference));
    return;
  }
  fmt::print(out, "run {}: {} positions of {}{}\n{}\n{}\n", reference.run, reference.samples,
             one_line(reference.source),
             reference.samples_left_out == 0
                 ? std::string{}
                 : fmt::format(", {} before or after the run left out", reference.samples_left_out),
             analysis::clock_in_words(reference), analysis::zero_in_words(reference));
}

void import_one(const ReferenceCommand& options, std::ostream& out) {
  const analysis::ReferenceRequest request = request_of(options);
  const Progress progress{"reference: clock and zero are found", options.form};
  if (const auto lock = config::FolderLock::try_take(options.data_dir)) {
    write(options, import_closed(options, request), out);
    return;
  }
  ask_station(options, "", json_of(request));
  write(options, read_stored(options, false).reference, out);
}

void remove_one(const ReferenceCommand& options, std::ostream& out) {
  if (const auto lock = config::FolderLock::try_take(options.data_dir)) {
    storage::Database database{options.data_dir / "station.sqlite"};
    value_of(storage::remove_reference(database.handle(), options.run, options.reason, command_line_author()));
    while (storage::delete_some_positions(database.handle())) continue;
  } else {
    ask_station(options, "/remove", {{"reason", options.reason}});
  }
  if (options.form.is_json) {
    write_json(out, {{"run_id", options.run}, {"reference", nullptr}});
  } else {
    fmt::print(out, "run {} has no reference any more\n", options.run);
  }
}

void export_csv(const ReferenceCommand& options, std::ostream& out) {
  const storage::StoredReference stored = read_stored(options, true);
  const storage::OutsidePositions& positions = stored.positions;
  fmt::print(out, "# {} of run {}, span {}\nrobot_time_us,position_m,position_sd_m\n",
             one_line(stored.reference.source), stored.reference.run, stored.reference.span);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    fmt::print(out, "{},{},{}\n", positions.robot_time_us[i], positions.position_m[i], positions.position_sd_m[i]);
  }
}

}  // namespace

void add_options(CLI::App& command, ReferenceCommand& options) {
  command.require_subcommand(1);
  auto* importing = offer(command, options, Act::import, "import", "Put a position measured from outside beside a run");
  add_json_flag(*importing, options.form);
  importing->add_option("--csv", options.csv_file, "Its columns: t_s, position_m and, if it has one, position_sd_m")
      ->required()
      ->check(named());
  importing
      ->add_option("--sd-mm", options.sd_mm, "How exact each position is (one sigma), without a column position_sd_m")
      ->check(from_to(1e-4, 1000));
  add_clock_options(*importing, options);
  importing->add_option("--span", options.span, "Which span of the run, if the robot rebooted during it")
      ->check(whole(0, std::numeric_limits<std::uint32_t>::max()));
  importing->add_flag("--keep-zero", options.keeps_zero, "Its zero is the robot's (default: estimated from the run)");
  importing->add_flag("--metres", options.is_in_metres, "Its positions are in metres, also where they do not look so");
  add_timeout_option(*importing, options.timeout_s);
  importing->add_option("--reason", options.reason, "Why another reference of the run is replaced")->check(named());
  importing->footer(
      "Without --offset-s, --utc-s or --marker the clock is found by correlation with the robot's own motion.\n"
      "Example: rheonaut reference import --run 1 --csv camera.csv --sd-mm 0.5 --data lab");
  add_json_flag(
      *offer(command, options, Act::show, "show", "Say what was imported, and how its clock and zero were found"),
      options.form);
  offer(command, options, Act::export_positions, "export", "Write its positions as CSV, on the robot's clock");
  auto* removing = offer(command, options, Act::remove, "remove", "Remove it");
  removing->add_option("--reason", options.reason, "Why")->required()->check(named());
  add_json_flag(*removing, options.form);
  command.footer("Example: rheonaut reference show --run 1 --data lab");
}

int run(const ReferenceCommand& options, std::ostream& out) {
  const fs::path database = options.data_dir / "station.sqlite";
  if (!runtime::is_there(database)) throw std::runtime_error{fmt::format("there is no '{}'", database.string())};
  switch (options.act) {
    case Act::import: import_one(options, out); break;
    case Act::show: write(options, read_stored(options, false).reference, out); break;
    case Act::export_positions: export_csv(options, out); break;
    case Act::remove: remove_one(options, out); break;
  }
  return 0;
}

}  // namespace server::cli
