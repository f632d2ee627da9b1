// The queue between the station and the disk.
#include "server/recording/recorder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <cmath>
#include <iterator>

#include "server/recording/file_check.hpp"
#include "server/recording/stored_rows.hpp"

namespace server {
namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kCommitInterval = 100ms;
constexpr microseconds kGroupAge = 1s;         // a robot's samples wait at most this long for a full segment
constexpr microseconds kHolePatience = 500ms;  // before a hole that does not shrink is asked for
constexpr microseconds kAskInterval = 1s;
constexpr microseconds kOverflowLogInterval = 10s;
constexpr microseconds kRetryInterval = 1s;  // after a commit that failed
constexpr microseconds kFailureLogInterval = 10s;
constexpr microseconds kKeepUnused = 60s;         // a boot's bookkeeping, after its last admission
constexpr std::uint64_t kMaxNumber = 1ULL << 62;  // of a sample, or microseconds: far from SQLite's signed limit
constexpr std::uint32_t kMaxPeriodUs = 10'000'000;

// What a table would refuse (NULL in a NOT NULL column) or no robot can mean. One such value in a commit would keep
// everything behind it from being stored.
bool is_malformed(const SampleBatch& batch) {
  const SampleContext& context = batch.context;
  const bool numbers = batch.first_seq < kMaxNumber && batch.oldest_seq < kMaxNumber &&
                       batch.first_robot_time_us < kMaxNumber && context.period_us > 0 &&
                       context.period_us <= kMaxPeriodUs;
  const bool finite = std::isfinite(context.disturbance_m) && std::isfinite(context.position_sd_m) &&
                      std::isfinite(context.setpoint_m.value_or(0));
  return batch.samples.empty() || !numbers || !finite;
}

}  // namespace

Recorder::Recorder(asio::io_context& loop, Clock& clock, WorkerThread& disk, RecorderOptions options)
    : loop_{loop}, clock_{clock}, disk_{disk}, options_{std::move(options)} {}

Recorder::~Recorder() = default;

asio::awaitable<RestoredState> Recorder::open() {
  auto job = [this, utc_us = clock_.utc_us()] {
    database_ = std::make_unique<Database>(options_.path);
    store_ = std::make_unique<SampleStore>(*database_);
    fail_unfinished_commands(*database_, utc_us);
    return RestoredState{database_->store_id(), BootStore{*database_}.robots(), pending_stops(*database_)};
  };
  co_return co_await disk_.run(std::move(job));
}

asio::awaitable<void> Recorder::run() {
  for (;;) {
    co_await wait_for_commit();
    if (!writing_.empty()) co_await write();  // the same content, until it is stored
    if (failing()) continue;
    std::vector<Flush> served = std::exchange(flushes_, {});
    take_for(served);
    co_await write();
    if (failing()) {
      std::ranges::move(served, std::back_inserter(flushes_));
      continue;
    }
    for (const Flush& flush : served) {
      if (const auto done = flush.done.lock()) done->notify();
    }
    ask_for_missing();
    forget_unused();
  }
}

asio::awaitable<void> Recorder::wait_for_commit() {
  if (failing()) {
    co_await clock_.sleep_until(retry_at_us_);
    co_return;
  }
  if (boots_.empty() && queue_.empty() && flushes_.empty()) {
    idle_ = true;
    co_await work_.wait();
    idle_ = false;
  }
  const std::int64_t regular_us = last_commit_us_ + kCommitInterval.count();
  while (flushes_.empty() && clock_.steady_us() < regular_us) {
    co_await (clock_.sleep_until(regular_us) || flush_wanted_.wait());
  }
  last_commit_us_ = clock_.steady_us();
}

asio::awaitable<void> Recorder::write() {
  if (writing_.empty()) co_return;
  auto job = [this] { return try_to_write(); };
  const std::string problem = co_await disk_.run(std::move(job));
  if (!problem.empty()) {
    note_failure(problem);
    co_return;
  }
  if (failing()) spdlog::info("recording goes on: what had waited for the disk is stored");
  retry_at_us_ = 0;
  problem_.clear();
  const WriteBatch written = std::exchange(writing_, {});
  set_durable(written);
}

std::string Recorder::try_to_write() {
  try {
    store_->write(writing_);
    return {};
  } catch (const std::exception& error) {  // disk full, locked, unreadable: never a reason to end the emergency stop
    return write_problem(error);
  }
}

void Recorder::note_failure(const std::string& problem) {
  problem_ = problem;
  const std::int64_t now_us = clock_.steady_us();
  ++counters_.commits_failed;
  if (!failing() || now_us - failure_logged_us_ >= kFailureLogInterval.count()) {
    failure_logged_us_ = now_us;
    spdlog::error(
        "nothing is recorded now, {} cannot be written: {}; it is tried again every second, and the robots keep what "
        "they can",
        options_.path.string(), problem);
  }
  retry_at_us_ = now_us + kRetryInterval.count();
}

void Recorder::take_for(const std::vector<Flush>& flushes) {
  std::set<BootId> flushed;
  for (const Flush& flush : flushes) {
    if (flush.boot_id) flushed.insert(*flush.boot_id);
  }
  take(std::ranges::any_of(flushes, &Flush::everything), flushed);
}

void Recorder::take(bool everything, const std::set<BootId>& flushed) {
  const std::int64_t now_us = clock_.steady_us();
  for (auto& [boot_id, boot] : boots_) {
    const bool at_once = everything || !boot.connected || flushed.contains(boot_id);
    boot.recording.take(queue_, now_us, at_once ? 0 : kGroupAge.count());
  }
  writing_ = std::exchange(queue_, {});
  queued_commands_.clear();
}

void Recorder::set_durable(const WriteBatch& written) {
  ++counters_.commits;
  std::unordered_map<std::int64_t, Boots::value_type*> by_key;
  for (auto& entry : boots_) by_key.emplace(entry.second.recording.key(), &entry);
  std::map<BootId, Boot*> touched;
  const auto recording = [&](std::int64_t boot_key) -> BootRecording& {
    auto& [boot_id, boot] = *by_key.at(boot_key);  // kept until everything of it is durable
    touched.emplace(boot_id, &boot);
    return boot.recording;
  };
  for (const Segment& segment : written.segments) {
    recording(segment.boot_key).set_durable({segment.first_seq, segment.next_seq()});
    counters_.samples_written += segment.samples.size();
    queued_samples_ -= segment.samples.size();
  }
  for (const LostRange& gap : written.gaps) {
    recording(gap.boot_key).set_durable(gap.lost);
    counters_.samples_lost += gap.lost.next - gap.lost.first;
  }
  for (const StoredEvent& stored : written.events) {
    if (!stored.event.event_seq) continue;
    recording(stored.boot_key).set_durable_events({*stored.event.event_seq, *stored.event.event_seq + 1});
  }
  for (const LostRange& gap : written.event_gaps) recording(gap.boot_key).set_durable_events(gap.lost);
  if (!on_durable_) return;
  for (const auto& [boot_id, boot] : touched) {
    on_durable_(boot->recording.robot_id(), boot_id, boot->recording.durable_next_seq(),
                boot->recording.durable_next_event_seq());
  }
}

void Recorder::ask_for_missing() {
  const bool drained = queued_samples_ <= options_.max_queued_samples / 2;
  if (!drained || !on_missing_) return;
  for (auto& [boot_id, boot] : boots_) {
    if (!boot.connected) continue;
    const auto hole = boot.recording.overdue(clock_.steady_us(), kHolePatience.count(), kAskInterval.count());
    if (hole) on_missing_(boot.recording.robot_id(), boot_id, hole->first, hole->next);
  }
}

void Recorder::forget_unused() {
  const std::int64_t now_us = clock_.steady_us();
  std::erase_if(boots_, [&](const Boots::value_type& entry) {
    const Boot& boot = entry.second;
    const bool unused = !boot.connected && boot.admissions == 0;
    const bool long_ago = boot.replaced || now_us - boot.last_used_us > kKeepUnused.count();
    return unused && long_ago && boot.recording.all_durable();
  });
}

void Recorder::close() {
  if (!store_) return;
  std::string problem = writing_.empty() ? "" : try_to_write();  // a commit that failed, or was cancelled
  if (problem.empty()) {
    writing_ = {};
    take(true);
    if (!writing_.empty()) problem = try_to_write();
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
    database_->checkpoint();
  } catch (const std::exception& error) {  // only the log stays longer: it is read at the next start
    spdlog::warn("the write-ahead log of {} could not be emptied: {}", options_.path.string(), error.what());
  }
  database_.reset();
}

asio::awaitable<Admission> Recorder::admit(AdmissionRequest request) {
  if (request.next_seq >= kMaxNumber || request.oldest_seq > request.next_seq || request.robot_time_us >= kMaxNumber) {
    Admission malformed;
    malformed.refusal = rheonaut_REFUSAL_REASON_MALFORMED;
    malformed.detail = fmt::format("oldest_seq {}, next_seq {} and robot time {} µs cannot be", request.oldest_seq,
                                   request.next_seq, request.robot_time_us);
    co_return malformed;
  }
  Boot& boot = boots_.try_emplace(request.boot_id, request.robot_id).first->second;
  struct Admitting {  // keeps the boot, whatever happens
    int& count;
    explicit Admitting(int& admissions) : count{admissions} { ++count; }
    ~Admitting() { --count; }
  };
  const Admitting admitting{boot.admissions};
  wake();
  auto job = [request, enrol = options_.enrol_on_loopback, load = !boot.recording.loaded()](Database& database) {
    try {
      return BootStore{database}.admit(request, enrol, load);
    } catch (const std::exception& error) {
      AdmissionOutcome busy;
      busy.admission.refusal = rheonaut_REFUSAL_REASON_STATION_BUSY;
      busy.admission.detail = fmt::format("the station's database cannot be used now: {}; try again", error.what());
      return busy;
    }
  };
  AdmissionOutcome outcome = co_await on_disk(std::move(job));
  co_return take_in(boot, std::move(outcome), request);
}

Admission Recorder::take_in(Boot& boot, AdmissionOutcome outcome, const AdmissionRequest& request) {
  Admission& admission = outcome.admission;
  if (admission.refusal != rheonaut_REFUSAL_REASON_NONE) return admission;
  if (admission.newly_enrolled) {
    spdlog::info("robot '{}' enrolled from loopback {} a token", request.robot_id,
                 request.token.empty() ? "without" : "with");
  }
  if (boot.replaced) {
    admission.refusal = rheonaut_REFUSAL_REASON_STATION_BUSY;
    admission.detail = "another boot of this robot has just connected; try again";
    return admission;
  }
  if (!boot.recording.loaded()) {
    boot.recording = BootRecording{request.robot_id};
    boot.recording.load(std::move(outcome.boot));
  }
  if (!boot.recording.continues(request.next_seq, request.robot_time_us)) {
    admission.refusal = rheonaut_REFUSAL_REASON_BOOT_ID_REUSED;
    admission.detail = fmt::format(
        "boot {} was already at a later sample or time than next_seq {} and {} µs; a boot_id must be random, new in "
        "each boot",
        request.boot_id, request.next_seq, request.robot_time_us);
    return admission;
  }
  boot.last_used_us = clock_.steady_us();
  boot.hello = BootStart{.robot_id = request.robot_id,
                         .boot_key = boot.recording.key(),
                         .announced_next_seq = request.next_seq,
                         .robot_time_us = request.robot_time_us,
                         .noticed_at_us = request.received_at_us};
  boot.hello_oldest_seq = request.oldest_seq;
  admission.durable_next_seq = boot.recording.durable_next_seq();
  admission.durable_next_event_seq = boot.recording.durable_next_event_seq();
  return admission;
}

void Recorder::on_robot(const RobotState& robot) {
  const auto found = boots_.find(robot.boot_id);
  if (found == boots_.end() || found->second.recording.robot_id() != robot.id) return;
  Boot& boot = found->second;
  boot.connected = robot.link == LinkState::connected && !boot.replaced;
  if (!boot.connected || !boot.hello) return;
  boot.recording.connect(*boot.hello, boot.hello_oldest_seq);
  replace_others(robot.id, robot.boot_id);
  queue_.boots.push_back(*boot.hello);
  boot.hello.reset();
  boot.started = true;
  wake();
}

void Recorder::replace_others(const RobotId& robot_id, BootId boot_id) {
  for (auto& [other_id, other] : boots_) {
    if (other_id == boot_id || other.recording.robot_id() != robot_id || !other.started) continue;
    other.connected = false;
    other.replaced = true;
    other.recording.give_up_below(other.recording.next_seq(), "reboot", clock_.utc_us());
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
  wake();
}

void Recorder::on_event(const RobotState&, const RobotEvent& event) {
  if (!room_for_record()) return;
  const auto found = boots_.find(event.boot_id);
  const bool known = found != boots_.end() && found->second.started && !found->second.replaced;
  if (event.event_seq) {
    if (!known || *event.event_seq >= kMaxNumber || event.oldest_event_seq >= kMaxNumber) return;
    const bool is_new = found->second.recording.append_event(*event.event_seq);
    found->second.recording.give_up_events_below(event.oldest_event_seq, event.received_at_us);
    if (!is_new) return;
  }
  queue_.events.push_back({known ? found->second.recording.key() : 0, event});
  wake();
}

void Recorder::on_command(const CommandRecord& command) {
  if (const auto queued = queued_commands_.find(command.id); queued != queued_commands_.end()) {
    queue_.commands[queued->second] = command;
    return;
  }
  // SAFETY: a stop must be known after a restart, so it is recorded whatever waits.
  if (command.kind != "emergency_stop" && !room_for_record()) return;
  queued_commands_.emplace(command.id, queue_.commands.size());
  queue_.commands.push_back(command);
  wake();
}

bool Recorder::room_for_record() {
  if (queue_.events.size() + queue_.commands.size() < options_.max_queued_records) return true;
  if (counters_.records_refused++ == 0)
    spdlog::error("the disk does not keep up: events and commands are not recorded");
  return false;
}

void Recorder::wake() {
  if (idle_) work_.notify();
}

}  // namespace server
