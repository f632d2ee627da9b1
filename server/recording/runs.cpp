// Checks on the loop, SQL on the disk thread.
#include "server/recording/runs.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "server/recording/recorder.hpp"
#include "server/recording/run_store.hpp"

namespace server {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t kMaxNameBytes = 200;
constexpr std::size_t kMaxTextBytes = 10'000;
constexpr std::size_t kMaxListed = 1000;
constexpr microseconds kEndPatience = 3s;
constexpr microseconds kEndLook = 50ms;

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
    if (text->size() > kMaxTextBytes) {
      return fail(ErrorCode::invalid, fmt::format("a run's texts have at most {} bytes each", kMaxTextBytes));
    }
  }
  return {};
}

bool is_complete(const Run& run) { return run.samples_stored + run.samples_lost >= run.samples_expected; }

Error disk_fails() {
  return {ErrorCode::unavailable, "the disk cannot be written now; the station's log says why. Try again", ""};
}

Error no_such_run(RunId id) { return {ErrorCode::not_found, fmt::format("there is no run {}", id), ""}; }

}  // namespace

const char* text(RunState value) {
  switch (value) {
    case RunState::open: return "open";
    case RunState::ended: return "ended";
    case RunState::interrupted: return "interrupted";
    case RunState::discarded: return "discarded";
  }
  return "open";
}

Runs::Runs(Clock& clock, Recorder& recorder) : clock_{clock}, recorder_{recorder} {}

asio::awaitable<void> Runs::load() {
  auto job = [](Database& database) { return RunStore{database, {}}.open_runs(); };
  open_runs_ = co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<Result<Run>> Runs::create(RobotId robot_id, RunConditions conditions, std::string made_by) {
  const Result<void> valid = check(conditions);
  if (!valid) co_return std::unexpected{valid.error()};
  const auto found = robots_.find(robot_id);
  if (found == robots_.end() || !found->second.connected) {
    co_return fail(ErrorCode::not_connected, fmt::format("robot '{}' is not connected", robot_id));
  }
  if (const auto open = open_runs_.find(robot_id); open != open_runs_.end()) {
    co_return fail(ErrorCode::conflict,
                   fmt::format("robot '{}' has an open run ({}); end it first", robot_id, open->second));
  }
  const Robot& robot = found->second;
  Run run;
  run.robot_id = robot_id;
  run.made_by = std::move(made_by);
  run.conditions = std::move(conditions);
  run.firmware_version = robot.firmware_version;
  run.controller_id = robot.controller_id;
  run.controller_checksum = robot.controller_checksum;
  run.parameters_checksum = robot.parameters_checksum;
  run.started_at_us = clock_.utc_us();
  run.spans.push_back({.boot_id = robot.boot_id, .first_seq = recorder_.next_seq(robot.boot_id), .last_seq = {}});

  struct Creating {  // no second run of this robot meanwhile; forgotten unless the run was made
    std::map<RobotId, RunId>& open;
    RobotId robot;
    ~Creating() {
      if (open[robot] == 0) open.erase(robot);
    }
  };
  open_runs_[robot_id] = 0;
  const Creating creating{open_runs_, robot_id};
  // The run is stored after the connection it begins in, so a later boot can follow it.
  const bool flushed = co_await recorder_.flush_records();
  if (!flushed) co_return std::unexpected{disk_fails()};
  auto job = [run](Database& database) { return RunStore{database, {}}.add(run); };
  const Result<RunId> id = co_await recorder_.on_disk(std::move(job));
  if (!id) co_return std::unexpected{id.error()};
  open_runs_[robot_id] = *id;
  run.id = *id;
  co_return run;
}

asio::awaitable<Result<Run>> Runs::end(RunId id, std::string verdict) {
  if (verdict.size() > kMaxTextBytes) {
    co_return fail(ErrorCode::invalid, fmt::format("a verdict has at most {} bytes", kMaxTextBytes));
  }
  const bool flushed = co_await recorder_.flush_records();  // a reboot heard before this moves the open span first
  if (!flushed) co_return std::unexpected{disk_fails()};
  const auto open = std::ranges::find(open_runs_, id, [](const auto& entry) { return entry.second; });
  if (id == 0 || open == open_runs_.end()) {
    const std::optional<Run> known = co_await read(id);
    if (!known) co_return std::unexpected{no_such_run(id)};
    co_return fail(ErrorCode::conflict, fmt::format("run {} has ended already", id));
  }
  const auto robot = robots_.find(open->first);
  const BootId boot_id = robot == robots_.end() ? 0 : robot->second.boot_id;
  auto job = [id, verdict, utc_us = clock_.utc_us(), heads = heads()](Database& database) {
    RunStore{database, heads}.end(id, verdict, utc_us);
  };
  struct Ending {  // by one request at a time; the run stays open when the job throws
    std::set<RunId>& ending;
    RunId id;
    ~Ending() { ending.erase(id); }
  };
  if (!ending_.insert(id).second) co_return fail(ErrorCode::conflict, fmt::format("run {} is being ended", id));
  {
    const Ending ending{ending_, id};
    co_await recorder_.on_disk(std::move(job));
  }
  std::erase_if(open_runs_, [id](const auto& entry) { return entry.second == id; });

  const std::int64_t deadline_us = clock_.steady_us() + kEndPatience.count();
  for (;;) {
    const bool stored = co_await recorder_.flush(boot_id);
    std::optional<Run> run = co_await read(id);
    if (!run) co_return std::unexpected{no_such_run(id)};
    if (!stored || is_complete(*run) || clock_.steady_us() >= deadline_us) co_return std::move(*run);
    co_await clock_.sleep_for(kEndLook);
  }
}

asio::awaitable<Result<Run>> Runs::find(RunId id) {
  std::optional<Run> run = co_await read(id);
  if (!run) co_return std::unexpected{no_such_run(id)};
  co_return std::move(*run);
}

asio::awaitable<std::optional<Run>> Runs::read(RunId id) {
  auto job = [id, heads = heads()](Database& database) { return RunStore{database, heads}.find(id); };
  co_return co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<std::vector<Run>> Runs::list(std::optional<RobotId> robot_id, RunId before, std::size_t limit) {
  limit = std::clamp<std::size_t>(limit, 1, kMaxListed);
  auto job = [robot_id, before, limit, heads = heads()](Database& database) {
    return RunStore{database, heads}.list(robot_id, before, limit);
  };
  co_return co_await recorder_.on_disk(std::move(job));
}

std::map<BootId, std::uint64_t> Runs::heads() const {
  std::map<BootId, std::uint64_t> heads;
  for (const auto& [robot_id, run_id] : open_runs_) {
    const auto robot = robots_.find(robot_id);
    if (robot != robots_.end()) heads[robot->second.boot_id] = recorder_.next_seq(robot->second.boot_id);
  }
  return heads;
}

void Runs::on_robot(const RobotState& state) {
  robots_[state.id] = {.connected = state.link == LinkState::connected,
                       .boot_id = state.boot_id,
                       .firmware_version = state.firmware_version,
                       .controller_id = state.context.controller_id,
                       .controller_checksum = state.controller_checksum,
                       .parameters_checksum = state.parameters_checksum};
}

void Runs::on_samples(const RobotState& robot, const SampleBatch&) {
  robots_[robot.id].controller_id = robot.context.controller_id;
}

}  // namespace server
