// Checks on the loop, SQL on the disk thread and the readers'.
#include "server/storage/runs/runs.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/run_store.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t kMaxNameBytes = 200;
constexpr std::size_t kMaxListed = 1001;  // a page, and one more that shows whether there are others

Error text_too_long() {
  return {ErrorCode::invalid, fmt::format("a run's texts have at most {} bytes each", kMaxRunTextBytes), ""};
}

Result<void> check(const RunConditions& conditions) {
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  const std::string& name = conditions.name;
  if (name.empty() || name.size() > kMaxNameBytes || std::ranges::any_of(name, is_control)) {
    return fail(ErrorCode::invalid,
                fmt::format("a run's name has 1 to {} bytes and no control characters", kMaxNameBytes));
  }
  for (const std::string* text :
       {&conditions.fluid, &conditions.pump_profile, &conditions.tube, &conditions.operator_name, &conditions.profile,
        &conditions.notes, &conditions.verdict}) {
    if (text->size() > kMaxRunTextBytes) return std::unexpected{text_too_long()};
  }
  return {};
}

Error disk_fails() {
  return {ErrorCode::unavailable, "the disk cannot be written now; the station's log says why. Try again", ""};
}

// SAFETY: a full disk does not keep the station from starting.
template <class Job>
auto or_problem(Job job) {
  return [job = std::move(job)](Database& database) -> Result<std::vector<InterruptedRun>> {
    try {
      return job(database);
    } catch (const SQLite::Exception& error) {
      return fail(ErrorCode::unavailable, runtime::text_of(error));
    }
  };
}

// SAFETY: its text stays as it was written, and says nothing of limits: those of the robot's own fluid hold, or if that
// is not known the strictest.
void report_fluid(const InterruptedRun& run, const config::Envelope& envelope) {
  if (run.fluid.empty() || envelope.listed(run.fluid)) return;
  spdlog::warn(
      "run {} of robot '{}' was open in the fluid '{}', which the configuration does not list: unless the fluid of the "
      "robot is known otherwise, the strictest limits of all fluids hold for it until its fluid is named",
      run.id, run.robot_id, run.fluid);
}

void report_interrupted(const Result<std::vector<InterruptedRun>>& interrupted, const config::Envelope& envelope) {
  if (!interrupted) {
    spdlog::warn("runs that were open cannot be interrupted now: {}; tried again", interrupted.error().detail);
    return;
  }
  for (const InterruptedRun& run : *interrupted) {
    const auto at_us = run.last_sample_at_us;
    const std::string end = at_us ? fmt::format("at its last sample, {:%Y-%m-%d %H:%M:%S}.{:03} UTC",
                                                fmt::gmtime(*at_us / 1'000'000), *at_us / 1000 % 1000)
                                  : "without a sample";
    spdlog::warn("run {} '{}' of robot '{}' was open when the station stopped: it is interrupted {}", run.id, run.name,
                 run.robot_id, end);
    report_fluid(run, envelope);
  }
}

}  // namespace

Runs::Runs(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader, RunDigester& digester)
    : clock_{clock}, recorder_{recorder}, reader_{reader}, digester_{digester}, changed_{recorder.loop()} {}

asio::awaitable<void> Runs::load() {
  auto by_stop = or_problem([](Database& database) {
    return read_interrupted(database.handle(), interrupted_since_start(database.handle()));
  });
  report_interrupted(co_await recorder_.on_disk(std::move(by_stop)), envelope_);
  co_await interrupt_open();
}

asio::awaitable<void> Runs::interrupt_open() {
  auto by_kill = or_problem([utc_us = clock_.utc_us()](Database& database) {
    return read_interrupted(database.handle(), RunStore{database}.interrupt(utc_us));
  });
  const auto interrupted = co_await recorder_.on_disk(std::move(by_kill));
  is_loaded_ = interrupted.has_value();
  report_interrupted(interrupted, envelope_);
}

// Makes of it the name as it is listed.
Result<void> Runs::check_fluid(std::string& fluid) const {
  Result<std::string> listed = envelope_.listed(fluid);
  if (!listed) return std::unexpected{listed.error()};
  fluid = std::move(*listed);
  return {};
}

asio::awaitable<Result<Run>> Runs::create(station::RobotId robot_id, RunConditions conditions, station::Author by) {
  Result<void> valid = check(conditions);
  if (valid) valid = check_fluid(conditions.fluid);
  if (!valid) co_return std::unexpected{valid.error()};
  const auto found = robots_.find(robot_id);
  if (found == robots_.end() || !found->second.connected) {
    co_return fail(ErrorCode::not_connected, fmt::format("robot '{}' is not connected", robot_id));
  }
  if (const auto open = open_runs_.find(robot_id); open != open_runs_.end()) {
    if (ending_.contains(open->second)) co_return std::unexpected{end_is_not_stored(open->second)};
    co_return fail(ErrorCode::conflict,
                   fmt::format("robot '{}' has an open run ({}); end it first", robot_id, open->second));
  }
  if (!is_loaded_) co_return std::unexpected{disk_fails()};
  const Robot& robot = found->second;
  by.at_us = clock_.utc_us();
  if (conditions.fluid.empty()) {
    conditions.fluid = robot.fluid;
  } else if (const auto named = on_fluid_(robot_id, conditions.fluid, by); !named) {
    co_return std::unexpected{named.error()};
  }
  Run run;
  run.robot_id = robot_id;
  run.made_by = by.actor;
  run.conditions = std::move(conditions);
  run.firmware_version = robot.firmware_version;
  run.controller_id = robot.controller_id;
  run.controller_checksum = robot.controller_checksum;
  run.parameters_checksum = robot.parameters_checksum;
  run.started_at_us = by.at_us;
  run.spans.push_back({.boot_id = robot.boot_id, .first_seq = recorder_.next_seq(robot.boot_id), .last_seq = {}});

  struct Creating {  // no second run of this robot meanwhile; forgotten unless the run was made
    std::map<station::RobotId, RunId>& open;
    station::RobotId robot;
    ~Creating() {
      if (open[robot] == 0) open.erase(robot);
    }
  };
  open_runs_[robot_id] = 0;
  const Creating creating{open_runs_, robot_id};
  // The run is stored after the connection it begins in, so a later boot can follow it.
  const bool flushed = co_await recorder_.flush_records();
  if (!flushed) co_return std::unexpected{disk_fails()};
  auto job = [run, document = station_document_, by](Database& database) -> Result<RunId> {
    try {
      return RunStore{database}.add(run, document, by);
    } catch (const SQLite::Exception& error) {
      spdlog::warn("a run cannot be begun: {}", runtime::text_of(error));
      return std::unexpected{disk_fails()};
    }
  };
  const Result<RunId> id = co_await recorder_.on_disk(std::move(job));
  if (!id) co_return std::unexpected{id.error()};
  open_runs_[robot_id] = *id;
  run.id = *id;
  co_return announced(std::move(run));
}

asio::awaitable<Result<Run>> Runs::make_afterwards(station::RobotId robot_id, RunConditions conditions,
                                                   RecordedRange range, station::Author by) {
  Result<void> valid = check(conditions);
  if (valid) valid = check_fluid(conditions.fluid);
  if (!valid) co_return std::unexpected{valid.error()};
  if (const auto* time = std::get_if<TimeSpan>(&range)) {
    if (time->from_us > time->to_us) co_return fail(ErrorCode::invalid, "from_us is later than to_us", "out_of_range");
    if (time->to_us > clock_.utc_us()) co_return fail(ErrorCode::invalid, "to_us is in the future", "out_of_range");
  }
  bool flushed = co_await recorder_.flush_boots();
  if (const auto robot = robots_.find(robot_id); flushed && robot != robots_.end()) {
    flushed = co_await recorder_.flush(robot->second.boot_id);
  }
  if (!flushed) co_return std::unexpected{disk_fails()};
  Run run;
  run.robot_id = std::move(robot_id);
  run.conditions = std::move(conditions);
  run.made_by = by.actor;
  by.at_us = clock_.utc_us();
  std::optional<RunId> id;
  while (!id) {  // again only when samples that were found have been purged before the run could hold them
    const Result<RecordedSamples> samples = co_await samples_in(run.robot_id, range);
    if (!samples) co_return std::unexpected{samples.error()};
    auto job = [run, found = *samples, by](Database& database) {
      return RunStore{database}.add_afterwards(run, found, by);
    };
    id = co_await recorder_.on_disk(std::move(job));
  }
  digester_.add(*id);
  const Result<void> made;
  co_return co_await changed(*id, made);
}

asio::awaitable<Result<RecordedSamples>> Runs::samples_in(station::RobotId robot_id, RecordedRange range) {
  RangeSearch search{std::move(robot_id), range};
  auto look = [&search](SQLite::Database& database) { return search.advance(database); };
  for (bool more = true; more;) more = co_await reader_.ask(look);
  co_return search.take();
}

asio::awaitable<Result<Run>> Runs::annotate(RunId id, RunAnnotation annotation, station::Author by) {
  RunConditions given;
  given.name = annotation.texts.contains("name") ? annotation.texts.at("name") : "unchanged";
  Result<void> outcome = check(given);
  for (const auto& [field, value] : annotation.texts) {
    if (outcome && value.size() > kMaxRunTextBytes) outcome = std::unexpected{text_too_long()};
  }
  by.at_us = clock_.utc_us();
  if (const auto fluid = annotation.texts.find("fluid"); outcome && fluid != annotation.texts.end()) {
    outcome = check_fluid(fluid->second);
    const auto open = std::ranges::find(open_runs_, id, [](const auto& entry) { return entry.second; });
    const bool is_open = open != open_runs_.end() && id != 0;
    const bool is_of_robot = is_open && annotation.names_fluid_of_robot && !fluid->second.empty();
    if (outcome && is_of_robot) outcome = on_fluid_(open->first, fluid->second, by);
  }
  if (!outcome) co_return std::unexpected{outcome.error()};
  const bool flushed = co_await recorder_.flush_records();
  if (!flushed) co_return std::unexpected{disk_fails()};
  auto job = [id, annotation, by](Database& database) { return RunStore{database}.annotate(id, annotation, by); };
  outcome = co_await recorder_.on_disk(std::move(job));
  co_return co_await changed(id, std::move(outcome));
}

asio::awaitable<Result<Run>> Runs::discard(RunId id, std::string reason, station::Author by) {
  if (reason.size() > kMaxRunTextBytes) co_return std::unexpected{text_too_long()};
  const bool flushed = co_await recorder_.flush_records();
  if (!flushed) co_return std::unexpected{disk_fails()};
  by.at_us = clock_.utc_us();
  auto job = [id, reason, by](Database& database) { return RunStore{database}.discard(id, reason, by); };
  Result<void> outcome = co_await recorder_.on_disk(std::move(job));
  co_return co_await changed(id, std::move(outcome));
}

asio::awaitable<Result<Run>> Runs::changed(RunId id, Result<void> outcome) {
  if (!outcome) co_return std::unexpected{outcome.error()};
  auto run = co_await find(id);
  if (run) on_change_(*run);
  co_return run;
}

Run Runs::announced(Run run) const {
  on_change_(run);
  return run;
}

asio::awaitable<Result<RunSnapshot>> Runs::snapshot(RunId id) {
  auto query = [id](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    return read_snapshot(database, id);
  };
  std::optional<RunSnapshot> snapshot = co_await reader_.ask(std::move(query));
  if (!snapshot) co_return std::unexpected{no_such_run(id)};
  co_return std::move(*snapshot);
}

asio::awaitable<std::optional<PerformedProfile>> Runs::performed_profile(RunId id) {
  auto query = [id](SQLite::Database& database) { return read_performed_profile(database, id); };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<Run>> Runs::find(RunId id) {
  std::optional<Run> run = co_await read(id);
  if (!run) co_return std::unexpected{no_such_run(id)};
  co_return std::move(*run);
}

asio::awaitable<std::optional<Run>> Runs::read(RunId id) {
  auto query = [id, heads = heads()](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    return find_run(database, heads, id);
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<std::vector<Run>> Runs::list(RunFilter filter) {
  filter.limit = std::clamp<std::size_t>(filter.limit, 1, kMaxListed);
  auto query = [filter, heads = heads()](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    return list_runs(database, heads, filter);
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<std::optional<RunConditions>> Runs::last_flow(station::RobotId robot_id) {
  auto query = [robot_id](SQLite::Database& database) { return last_flow_of(database, robot_id); };
  co_return co_await reader_.ask(std::move(query));
}

std::map<station::BootId, std::uint64_t> Runs::heads() const {
  std::map<station::BootId, std::uint64_t> heads;
  for (const auto& [robot_id, run_id] : open_runs_) {
    const auto robot = robots_.find(robot_id);
    if (robot != robots_.end()) heads[robot->second.boot_id] = recorder_.next_seq(robot->second.boot_id);
  }
  return heads;
}

void Runs::on_robot(const station::RobotState& state) {
  robots_[state.id] = {.connected = state.link == station::LinkState::connected,
                       .boot_id = state.boot_id,
                       .firmware_version = state.firmware_version,
                       .controller_id = state.context.controller_id,
                       .controller_checksum = state.controller_checksum,
                       .parameters_checksum = state.parameters_checksum,
                       .fluid = state.fluid};
}

}  // namespace server::storage
