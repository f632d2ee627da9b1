// The queue between the station and the disk.
#include "server/storage/ingest/recorder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <iterator>

#include "server/storage/database/disk_reserve.hpp"
#include "server/storage/samples/stored_rows.hpp"

namespace server {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kCommitInterval = 100ms;
constexpr microseconds kOverflowLogInterval = 10s;
constexpr std::uint32_t kMaxPeriodUs = 10'000'000;

// What no robot can mean. One such value in a commit might keep everything behind it from being stored.
bool is_malformed(const SampleBatch& batch) {
  const std::uint32_t period_us = batch.context.period_us;
  const bool numbers = batch.first_seq < kMaxRecordedNumber && batch.oldest_seq < kMaxRecordedNumber &&
                       batch.first_robot_time_us < kMaxRecordedNumber && period_us > 0 && period_us <= kMaxPeriodUs;
  return batch.samples.empty() || !numbers;
}

AuditNote of_station(const char* action, std::int64_t utc_us) {
  AuditNote note;
  note.by = {"station", "", utc_us};
  note.action = action;
  return note;
}

}  // namespace

Recorder::Recorder(asio::io_context& loop, Clock& clock, WorkerThread& disk, WorkerThread& checkpoints,
                   RecorderOptions options)
    : loop_{loop},
      clock_{clock},
      disk_{disk},
      options_{std::move(options)},
      checkpointer_{loop, clock, checkpoints, options_.path, options_.checkpoint_bytes, options_.checkpoint_interval} {}

Recorder::~Recorder() = default;

asio::awaitable<RestoredState> Recorder::open() {
  auto job = [this, utc_us = clock_.utc_us()] {
    const std::filesystem::path folder = std::filesystem::absolute(options_.path).parent_path();
    std::error_code not_told;  // then it counts as much
    give_up_disk_reserve(options_.path, std::filesystem::space(folder, not_told).available);
    database_ = std::make_unique<Database>(options_.path);
    store_ = std::make_unique<SampleStore>(*database_);
    try {
      fail_unfinished_commands(*database_, utc_us);
    } catch (const SQLite::Exception& error) {  // SAFETY: with a full disk, too, robots come in and can be stopped
      spdlog::warn("commands of an earlier start stay unfinished in the record: {}", error.what());
    }
    keep_disk_reserve(options_.path, std::filesystem::space(folder, not_told).available);
    BootStore boots{*database_};
    next_boot_key_ = boots.next_boot_key();
    restored_at_us_ = database_->restored_at_us();
    spdlog::info("audit: goes on from {}", text(audit_head(database_->handle())));
    return RestoredState{database_->store_id(), boots.robots(), pending_stops(*database_)};
  };
  RestoredState restored = co_await disk_.run(std::move(job));
  AuditNote started = of_station("station.started", clock_.utc_us());
  started.detail = fmt::format(R"({{"version":"{}","store_id":"{}"}})", RHEONAUT_VERSION, restored.store_id);
  on_audit(started);
  co_return restored;
}

asio::awaitable<void> Recorder::run() {
  for (;;) {
    co_await wait_for_commit();
    co_await checkpointer_.wait_for_room();
    if (writing_.empty()) take();  // or the same content, until it is stored
    co_await write();
    forget_unused();
    if (failing()) continue;
    end_flushes();
    co_await finish_checkpoint();
    co_await ask_for_missing();
  }
}

asio::awaitable<void> Recorder::wait_for_commit() {
  if (failing()) {
    co_await clock_.sleep_until(retry_at_us_);
    co_return;
  }
  if (boots_.empty() && queue_.empty() && flushes_.empty() && !quota_.has_left_out()) {
    idle_ = true;
    co_await work_.wait();
    idle_ = false;
  }
  const std::int64_t regular_us = last_commit_us_ + kCommitInterval.count();
  while (flushes_.empty() && clock_.steady_us() < regular_us) {
    co_await flush_wanted_.wait_until(clock_, regular_us);
  }
  last_commit_us_ = clock_.steady_us();
}

void Recorder::close(const std::function<void(Database&, std::int64_t)>& last) {
  if (!store_) return;
  tell_left_out(true);
  std::string problem;
  for (;;) {  // first a commit that failed, or was cancelled
    if (writing_.empty()) {
      for (BootEntry& entry : boots_) entry.second.is_written = false;
      writing_boots_.clear();
      line_up_everything();
      take();
    }
    if (writing_.empty()) break;
    problem = try_to_write();
    if (!problem.empty()) break;
    count_written(writing_);
    writing_ = {};
  }
  if (!problem.empty()) {
    spdlog::error(
        "the last {} samples, {} events and {} commands could not be written into {}: {}. Robots send again what they "
        "still hold",
        queued_samples_, writing_.events.size() + queue_.events.size(),
        writing_.commands.size() + queue_.commands.size(), options_.path.string(), problem);
  }
  writing_ = {};
  store_.reset();
  try {
    if (last) last(*database_, clock_.utc_us());
    const AuditHead head = append_audit(database_->handle(), of_station("station.stopped", clock_.utc_us()));
    spdlog::info("audit: ends with {}", text(head));
  } catch (const std::exception& error) {
    spdlog::warn("the last words of the audit could not be written: {}", error.what());
  }
  try {
    database_->checkpoint();
  } catch (const std::exception& error) {  // only the log stays longer: it is read at the next start
    spdlog::warn("the write-ahead log of {} could not be emptied: {}", options_.path.string(), error.what());
  }
  database_.reset();
}

void Recorder::on_robot(const RobotState& robot) {
  const auto found = boots_.find(robot.boot_id);
  if (found == boots_.end() || found->second.recording.robot_id() != robot.id) return;
  Boot& boot = found->second;
  boot.connected = robot.link == LinkState::connected && !boot.replaced;
  if (boot.connected && boot.hello) {
    const AdmissionRequest hello = *std::exchange(boot.hello, {});
    boot.recording.connect(hello, restored_at_us_);
    replace_others(robot.id, robot.boot_id);
    boot.starts_waiting -= std::erase_if(
        starts_, [&](const WaitingStart& waiting) { return waiting.start.boot_key == boot.recording.key(); });
    ++boot.starts_waiting;
    starts_.push_back({{.robot_id = hello.robot_id,
                        .boot_key = boot.recording.key(),
                        .announced_next_seq = hello.next_seq,
                        .announced_next_event_seq = hello.next_event_seq,
                        .robot_time_us = hello.robot_time_us,
                        .noticed_at_us = hello.received_at_us},
                       lined_up_});
    boot.started = true;
  }
  watch(*found);
}

// Those that have ever connected, as BootStore::start() ends them in the database.
void Recorder::replace_others(const RobotId& robot_id, BootId boot_id) {
  const auto [begin, end] = by_robot_.equal_range(robot_id);
  for (auto of_robot = begin; of_robot != end; ++of_robot) {
    BootEntry& entry = *of_robot->second;
    Boot& other = entry.second;
    if (entry.first == boot_id || other.recording.connected_at_us() == 0) continue;
    const char* cause = other.recording.connected_at_us() < restored_at_us_ ? "restore" : "reboot";
    other.connected = false;
    replaced_boots_ += other.replaced ? 0 : 1;
    other.replaced = true;
    other.recording.give_up_below(other.recording.next_seq(), cause, clock_.utc_us());
    other.recording.give_up_events_below(other.recording.next_event_seq(), cause, clock_.utc_us());
    line_up(entry, true);
    watch(entry);
  }
}

void Recorder::on_samples(const RobotState&, const SampleBatch& batch) {
  const auto found = boots_.find(batch.boot_id);
  if (is_malformed(batch) || found == boots_.end() || !found->second.started || found->second.replaced) {
    ++counters_.batches_malformed;
    return;
  }
  BootRecording& recording = found->second.recording;
  const std::size_t added = recording.count_new(batch);
  counters_.samples_duplicate += batch.samples.size() - added;
  if (queued_samples_ + added > options_.max_queued_samples) {
    recording.refuse(batch);
    counters_.samples_refused += added;
    const std::int64_t now_us = clock_.steady_us();
    if (now_us - overflow_logged_us_ >= kOverflowLogInterval.count()) {
      overflow_logged_us_ = now_us;
      spdlog::warn("the disk does not keep up: {} samples wait, {} were refused so far and will be asked for again",
                   queued_samples_, counters_.samples_refused);
    }
  } else {
    recording.append(batch, clock_.steady_us());
    queued_samples_ += added;
  }
  recording.give_up_below(batch.oldest_seq, "ring_overrun", batch.received_at_us);
  watch(*found);
}

// Null unless samples of the boot are recorded now.
Recorder::BootEntry* Recorder::recorded(BootId boot_id) {
  const auto found = boots_.find(boot_id);
  return found != boots_.end() && found->second.started && !found->second.replaced ? &*found : nullptr;
}

void Recorder::on_unusable_samples(const RobotState& robot, std::uint64_t first_seq, std::uint64_t next_seq) {
  ++counters_.batches_malformed;
  BootEntry* entry = recorded(robot.boot_id);
  if (entry == nullptr || next_seq > kMaxRecordedNumber) return;
  entry->second.recording.give_up({first_seq, next_seq}, "invalid", robot.last_received_at_us);
  watch(*entry);
}

void Recorder::on_unusable_event(const RobotState& robot, std::uint64_t event_seq) {
  BootEntry* entry = recorded(robot.boot_id);
  if (entry == nullptr || event_seq >= kMaxRecordedNumber) return;
  entry->second.recording.give_up_event(event_seq, "invalid", robot.last_received_at_us);
  watch(*entry);
}

// SAFETY: whatever waits, since its limits must hold after a restart. One entry for each robot at most.
void Recorder::on_fluid(const RobotState& robot) {
  queue_.fluids[robot.id] = robot.fluid;
  wake();
}

void Recorder::on_event(const RobotState&, const RobotEvent& event) {
  const auto found = boots_.find(event.boot_id);
  const bool known = found != boots_.end() && found->second.started && !found->second.replaced;
  if (!event.event_seq) {
    if (!room_for_record()) return;
    queue_.events.push_back({known ? found->second.recording.key() : 0, event});
    return wake();
  }
  if (!known || *event.event_seq >= kMaxRecordedNumber || event.oldest_event_seq >= kMaxRecordedNumber) return;
  BootRecording& recording = found->second.recording;
  if (!room_for_record()) {
    recording.refuse_event(*event.event_seq);
  } else if (recording.append_event(*event.event_seq)) {
    queue_.events.push_back({recording.key(), event});
  }
  recording.give_up_events_below(event.oldest_event_seq, "ring_overrun", event.received_at_us);
  watch(*found);
}

void Recorder::on_command(const CommandRecord& command) {
  if (const auto queued = queued_commands_.find(command.id); queued != queued_commands_.end()) {
    queue_.commands[queued->second] = command;
    return;
  }
  // SAFETY: a stop must be known after a restart, so it is recorded whatever waits.
  if (command.kind != "emergency_stop" && !room_for_record()) return quota_.leave_out("command");
  queued_commands_.emplace(command.id, queue_.commands.size());
  queue_.commands.push_back(command);
  wake();
}

void Recorder::on_audit(const AuditNote& note) {
  wake();
  if (note.can_flood && !quota_.take(note.action, clock_.steady_us())) return;
  if (!room_for_record()) return quota_.leave_out(note.action);
  queue_.audit.push_back(note);
}

// What has no entry is an entry, too: nobody can make the audit silent unseen.
void Recorder::tell_left_out(bool at_once) {
  for (const auto& [action, count] : quota_.tell(clock_.steady_us(), at_once)) {
    AuditNote note = of_station("audit.left_out", clock_.utc_us());
    note.subject = action;
    note.detail = fmt::format(R"({{"count":{}}})", count);
    queue_.audit.push_back(std::move(note));
  }
}

void Recorder::on_clock(const RobotState&, const ClockRecord& record) {
  const std::int64_t boot_key = key_of(record.boot_id);
  if (boot_key == 0 || !room_for_record()) return;
  queue_.clocks.push_back({boot_key, record});
  wake();
}

void Recorder::on_in_force(const RobotState&, const InForceRecord& record) {
  const std::int64_t boot_key = key_of(record.boot_id);
  if (boot_key == 0 || record.first_seq >= kMaxRecordedNumber || !room_for_record()) return;
  queue_.in_force.push_back({boot_key, record});
  wake();
}

// 0 unless samples of the boot are recorded now.
std::int64_t Recorder::key_of(BootId boot_id) const {
  const auto found = boots_.find(boot_id);
  const bool known = found != boots_.end() && found->second.started && !found->second.replaced;
  return known ? found->second.recording.key() : 0;
}

bool Recorder::room_for_record() {
  if (queued_records() < options_.max_queued_records) return true;
  if (counters_.records_refused++ == 0)
    spdlog::error("the disk does not keep up: commands are not recorded, events are asked for again");
  return false;
}

void Recorder::wake() {
  if (idle_) work_.notify();
}

}  // namespace server
