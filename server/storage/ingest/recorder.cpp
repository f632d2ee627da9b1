#include "server/storage/ingest/recorder.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "base/version.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/ingest/boot_segments.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kCommitInterval = 100ms;
constexpr microseconds kBehind = 1min;
// Boots in one turn of the loop, which must not take over 1 ms; for those that are reported a robot gets a frame each.
constexpr std::size_t kBootsInATurn = 128;
constexpr std::size_t kReportsInATurn = 32;

station::AuditNote of_station(const char* action, std::int64_t utc_us) {
  station::AuditNote note;
  note.by = {"station", "", utc_us};
  note.action = action;
  return note;
}

// 0: there is none.
std::int64_t newest_audit_us(Database& database) {
  SQLite::Statement newest{database.handle(), "SELECT at_us FROM audit ORDER BY entry DESC LIMIT 1"};
  return newest.executeStep() ? newest.getColumn(0).getInt64() : 0;
}

void warn_if_behind(std::int64_t now_us, std::int64_t newest_us) {
  const std::int64_t behind_us = newest_us - now_us;
  if (behind_us < kBehind.count()) return;
  spdlog::warn(
      "the clock of this computer is {} s behind what was recorded last, {:%F %T} UTC: it is wrong now, or was wrong "
      "then; set it before anything is recorded",
      behind_us / 1'000'000, fmt::gmtime(static_cast<std::time_t>(newest_us / 1'000'000)));
}

}  // namespace

Recorder::Recorder(asio::io_context& loop, runtime::Clock& clock, runtime::WorkerThread& disk,
                   runtime::WorkerThread& checkpoints, RecorderOptions options)
    : loop_{loop},
      clock_{clock},
      options_{std::move(options)},
      checkpointer_{loop, clock, checkpoints, options_.path, options_.checkpoint_bytes, options_.checkpoint_interval},
      database_{disk, checkpointer_, options_.path, options_.rescue},
      admission_{loop, [this](std::vector<AdmissionQuestion> all) { return ask_database(std::move(all)); }},
      boots_{std::make_unique<BootRegistry>()},
      queue_{std::make_unique<CommitQueue>(options_.max_queued_samples, options_.max_queued_records)},
      flushes_{loop, clock} {}

Recorder::~Recorder() = default;

asio::awaitable<RestoredState> Recorder::open() {
  OpenedDatabase opened = co_await database_.open(clock_.utc_us());
  boots_ = std::make_unique<BootRegistry>(opened.next_boot_key, opened.restored_at_us);
  const std::int64_t newest_us = co_await on_disk(newest_audit_us);
  warn_if_behind(clock_.utc_us(), newest_us);
  station::AuditNote started = of_station("station.started", clock_.utc_us());
  started.detail = fmt::format(R"({{"version":"{}","store_id":"{}"}})", base::version(), opened.restored.store_id);
  on_audit(started);
  co_return std::move(opened.restored);
}

asio::awaitable<void> Recorder::run() {
  for (;;) {
    co_await wait_for_commit();
    if (committing_since_us_ == 0) committing_since_us_ = clock_.steady_us();
    co_await checkpointer_.wait_for_room();
    if (!queue_->has_commit()) build_commit();  // or the same content, until it is stored
    co_await write();
    boots_->forget_unused(clock_.steady_us());
    report_returned();
    if (failing()) continue;
    flushes_.on_durable(queue_->position());
    co_await finish_checkpoint();
    committing_since_us_ = 0;
    co_await ask_for_missing();
  }
}

asio::awaitable<void> Recorder::wait_for_commit() {
  if (failing()) co_return co_await clock_.sleep_until(failure_.retry_at_us());
  const bool has_records = !queue_->has_no_records() || !renewals_.empty() || quota_.has_left_out();
  if (boots_->empty() && !has_records && flushes_.empty()) {
    idle_ = true;
    co_await work_.wait();
    idle_ = false;
  }
  co_await flushes_.until_wanted(last_commit_us_ + kCommitInterval.count());
  last_commit_us_ = clock_.steady_us();
}

void Recorder::build_commit() {
  enqueue(renewals_.take_ended(clock_.steady_us()));
  record_left_out(false);
  enqueue_due(*boots_, *queue_, clock_.steady_us());
  queue_->build_commit(boots_->with_records());
  flushes_.on_commit_built();
}

asio::awaitable<void> Recorder::write() {
  if (!queue_->has_commit()) co_return;
  const std::int64_t begun_us = clock_.steady_us();
  counters_.samples_at_commit.add(static_cast<std::int64_t>(queued_samples()));
  const std::string problem = co_await database_.write(queue_->commit());
  if (!problem.empty()) {
    ++counters_.commits_failed;
    failure_.on_failed(problem, options_.path, clock_.steady_us());
    co_return;
  }
  failure_.on_written();
  counters_.commit_times.add(clock_.steady_us() - begun_us);
  WriteBatch written = queue_->finish_commit();
  const bool had_samples = counters_.samples_written > 0;
  counters_.count_written(written);
  for (const Change& change : written.changes) change.stored();
  if (!had_samples && counters_.samples_written > 0) checkpointer_.pass_at_once();
  co_await report_durable(std::move(written.progress));
}

// In turns, so that nothing else on the loop waits for all of them.
asio::awaitable<void> Recorder::report_durable(std::vector<BootProgress> progress) {
  std::size_t reported = 0;
  for (const BootProgress& now : progress) {
    BootEntry& boot = *queue_->take_finished();
    boot.recording.set_durable(now);
    if (on_durable_) {
      on_durable_(boot.recording.robot_id(), boot.boot_id, now.durable_next_seq, now.durable_next_event_seq);
    }
    if (++reported % kReportsInATurn == 0) co_await asio::post(loop_, asio::use_awaitable);
  }
}

asio::awaitable<void> Recorder::finish_checkpoint() {
  if (!checkpointer_.wants_finish()) co_return;
  const CheckpointMode mode = checkpointer_.finish_mode();
  auto finish = [mode](Database& database) { return checkpoint(database.handle(), mode); };
  const CheckpointOutcome outcome = co_await on_disk(std::move(finish));
  checkpointer_.on_finish(mode, outcome);
}

// All that miss something, in turns.
asio::awaitable<void> Recorder::ask_for_missing() {
  const std::int64_t now_us = clock_.steady_us();
  const bool room_for_samples = on_missing_ && queue_->is_half_empty_of_samples();
  const bool room_for_events = on_missing_events_ && queue_->is_half_empty_of_records();
  for (std::size_t left = boots_->holes(); left > 0; --left) {
    if (left % kBootsInATurn == 0) co_await asio::post(loop_, asio::use_awaitable);
    BootEntry* boot = boots_->next_with_holes();
    if (boot == nullptr) continue;
    const station::RobotId& robot_id = boot->recording.robot_id();
    if (room_for_samples) {
      const auto hole = boot->recording.overdue_samples(now_us);
      if (hole) on_missing_(robot_id, boot->boot_id, hole->first, hole->next);
    }
    if (room_for_events && boot->recording.has_overdue_events(now_us)) {
      ++counters_.events_asked_again;
      on_missing_events_(robot_id, boot->boot_id);
    }
  }
}

void Recorder::close(const std::function<void(Database&, std::int64_t)>& last) {
  if (!database_.is_open()) return;
  enqueue(renewals_.take_all());
  record_left_out(true);
  const std::string problem = write_rest();
  if (!problem.empty()) {
    spdlog::error(
        "the last {} samples, {} events and {} commands could not be written into {}: {}. Robots send again what they "
        "still hold",
        queue_->samples(), queue_->events(), queue_->commands(), options_.path.string(), problem);
  }
  database_.close(last, clock_, of_station("station.stopped", clock_.utc_us()));
}

// First a commit that failed, or was cancelled. Returns the problem.
std::string Recorder::write_rest() {
  for (;;) {
    if (!queue_->has_commit()) {
      queue_->forget_finished();
      enqueue_everything(*boots_, *queue_);
      build_commit();
    }
    if (!queue_->has_commit()) return {};
    std::string problem = database_.write_now(queue_->commit());
    if (!problem.empty()) return problem;
    counters_.count_written(queue_->finish_commit());
  }
}

asio::awaitable<station::Admission> Recorder::admit(station::AdmissionRequest request) {
  BootEntry& boot = boots_->enter(request.boot_id, request.robot_id);
  const runtime::Counted admitting{boot.admissions};  // keeps the boot, whatever happens
  wake();
  AdmissionQuestion question{request, boot.owner()};
  const std::int64_t asked_us = clock_.steady_us();
  bool is_ending = boots_->another_starts(request, asked_us);
  AdmissionOutcome outcome = co_await admission_.ask(std::move(question));
  is_ending = is_ending || boots_->another_starts(request, asked_us);
  const bool is_stored = outcome.boot.key != 0;
  station::Admission admission =
      is_stored && is_ending ? another_boot_connected() : admit_boot(boot, std::move(outcome), request);
  if (!boot.recording.loaded() && boot.admissions == 1) boots_->forget_soon();
  co_return admission;
}

station::Admission Recorder::admit_boot(BootEntry& boot, AdmissionOutcome outcome,
                                        const station::AdmissionRequest& request) {
  if (outcome.admission.refusal != rheonaut_REFUSAL_REASON_NONE) return std::move(outcome.admission);
  const bool is_new = !boot.recording.loaded() && outcome.boot.key == 0;
  if (is_new && !queue_->has_room_for_boot()) {
    return refusal(rheonaut_REFUSAL_REASON_STATION_BUSY, "too many new boots wait for the disk; try again");
  }
  station::Admission admission =
      boots_->admit(boot, std::move(outcome.boot), std::move(outcome.admission), request, clock_.steady_us());
  if (is_new) queue_->enqueue(NewBoot{boot.recording.key(), request});
  return admission;
}

asio::awaitable<std::vector<AdmissionOutcome>> Recorder::ask_database(std::vector<AdmissionQuestion> questions) {
  auto job = [questions = std::move(questions), enrol = options_.enrolment](Database& database) {
    return BootStore{database}.admit(questions, enrol);
  };
  co_return co_await on_disk(std::move(job));
}

// What has no entry is an entry, too: nobody can make the audit silent unseen.
void Recorder::record_left_out(bool at_once) {
  for (const auto& [action, count] : quota_.report(clock_.steady_us(), at_once)) {
    station::AuditNote note = of_station("audit.left_out", clock_.utc_us());
    note.subject = action;
    note.detail = fmt::format(R"({{"count":{}}})", count);
    queue_->enqueue(std::move(note));
  }
}

void Recorder::store(Change change) {
  queue_->enqueue(std::move(change));
  wake();
}

microseconds Recorder::not_recording_for() const {
  return microseconds{committing_since_us_ == 0 ? 0 : clock_.steady_us() - committing_since_us_};
}

void Recorder::watch(BootEntry& boot) {
  boots_->watch(boot);
  wake();
}

void Recorder::wake() {
  if (idle_) work_.notify();
}

std::size_t Recorder::queued_samples() const { return queue_->samples(); }

std::uint64_t Recorder::next_seq(station::BootId boot_id) const {
  const BootEntry* boot = boots_->find(boot_id);
  return boot == nullptr ? 0 : boot->recording.next_seq();
}

std::vector<Segment> Recorder::waiting(station::BootId boot_id, Interval samples, std::size_t limit) const {
  const BootEntry* boot = boots_->find_loaded(boot_id);
  return boot == nullptr ? std::vector<Segment>{} : waiting_samples(*queue_, *boot, samples, limit);
}

std::vector<LostRange> Recorder::waiting_gaps(station::BootId boot_id, Interval samples) const {
  const BootEntry* boot = boots_->find_loaded(boot_id);
  return boot == nullptr ? std::vector<LostRange>{} : storage::waiting_gaps(*queue_, *boot, samples);
}

asio::awaitable<bool> Recorder::flush() {
  enqueue_everything(*boots_, *queue_);
  co_return co_await flush_until(queue_->end());
}

asio::awaitable<bool> Recorder::flush(station::BootId boot_id) {
  BootEntry* boot = boots_->find(boot_id);
  if (boot == nullptr || !boot->recording.loaded() || boot->is_stored()) co_return true;
  queue_->enqueue_segments(*boot, true);
  co_return co_await flush_until(queue_->end());
}

asio::awaitable<bool> Recorder::flush_records() { co_return co_await flush_until(queue_->end_of_starts()); }

asio::awaitable<bool> Recorder::flush_boots() {
  if (!queue_->has_starts()) co_return true;
  co_return co_await flush_records();
}

asio::awaitable<bool> Recorder::flush_until(QueuePosition position) {
  wake();
  co_return co_await flushes_.wait_for(position);
}

}  // namespace server::storage
