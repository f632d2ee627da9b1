// From the boots into the line, from the line into commits, and back with what has become durable.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "server/storage/database/file_check.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

// A robot's samples wait at most this long for a complete segment: a second, and what frames of up to 0.25 s and late
// ones need to complete it.
constexpr microseconds kGroupAge = 1100ms;
constexpr microseconds kRetryInterval = 1s;  // after a commit that failed
constexpr microseconds kFailureLogInterval = 10s;
// Boots in one turn of the loop, which must not take over 1 ms; those that are told something get a frame each.
constexpr std::size_t kBootsInATurn = 128;
constexpr std::size_t kToldInATurn = 32;

}  // namespace

// After every change of a boot: whoever must look at it hears of it.
void Recorder::watch(BootEntry& entry) {
  Boot& boot = entry.second;
  const BootRecording& recording = boot.recording;
  const bool waits = !recording.waiting().empty();
  if (!boot.is_due && (recording.has_complete() || (waits && !boot.connected))) {
    boot.is_due = true;
    due_.push_back(&entry);
  }
  if (!boot.is_ageing && waits) {
    boot.is_ageing = true;
    ageing_.push({recording.waiting_since_us() + kGroupAge.count(), &entry});
  }
  if (!boot.has_records && recording.has_records()) {
    boot.has_records = true;
    with_records_.push_back(&entry);
  }
  if (!boot.has_hole && boot.connected && recording.has_hole()) {
    boot.has_hole = true;
    with_holes_.push_back(&entry);
  }
  wake();
}

void Recorder::line_up(BootEntry& entry, bool all) {
  Boot& boot = entry.second;
  const std::size_t before = line_.size();
  boot.recording.take_segments(all || !boot.connected, line_);
  const std::size_t added = line_.size() - before;
  for (std::size_t at = before; at < line_.size(); ++at) line_samples_ += line_[at].samples.size();
  boot.in_line += added;
  lined_up_ += added;
}

void Recorder::line_up_everything() {
  for (BootEntry& entry : boots_) line_up(entry, true);
}

// Only as much as a commit takes: the rest is not touched until its turn. First the complete segments, so that what has
// just begun after one is not taken for old.
void Recorder::line_up_due() {
  const std::int64_t now_us = clock_.steady_us();
  while (!due_.empty() && line_samples_ < kMaxCommitSamples) {
    BootEntry& entry = *due_.front();
    due_.pop_front();
    entry.second.is_due = false;
    line_up(entry, false);
  }
  while (!ageing_.empty() && ageing_.top().due_us <= now_us && line_samples_ < kMaxCommitSamples) {
    BootEntry& entry = *ageing_.top().boot;
    ageing_.pop();
    entry.second.is_ageing = false;
    const BootRecording& recording = entry.second.recording;
    const bool is_old = now_us - recording.waiting_since_us() >= kGroupAge.count();
    if (!recording.waiting().empty() && is_old) line_up(entry, true);
    watch(entry);
  }
}

void Recorder::take() {
  tell_left_out(false);
  line_up_due();
  writing_ = std::exchange(queue_, {});
  queued_commands_.clear();
  take_records();
  take_from_line();
  while (!starts_.empty() && starts_.front().after <= left_line_) {
    writing_.boots.push_back(std::move(starts_.front().start));
    starts_.pop_front();
  }
  for (const BootEntry* entry : writing_boots_) writing_.progress.push_back(entry->second.recording.progress());
  for (Flush& flush : flushes_) flush.is_taken = true;
}

void Recorder::take_records() {
  for (BootEntry* entry : std::exchange(with_records_, {})) {
    entry->second.has_records = false;
    entry->second.recording.take_records(writing_);
    add_to_commit(*entry);
  }
}

void Recorder::take_from_line() {
  std::size_t samples = 0;
  while (!line_.empty() && samples + line_.front().samples.size() <= kMaxCommitSamples) {
    Segment& segment = line_.front();
    BootEntry& entry = *by_key_.at(segment.boot_key);  // kept until everything of it is durable
    samples += segment.samples.size();
    entry.second.recording.set_taken(segment);
    --entry.second.in_line;
    add_to_commit(entry);
    writing_.segments.push_back(std::move(segment));
    line_.pop_front();
    ++left_line_;
  }
  line_samples_ -= samples;
}

void Recorder::add_to_commit(BootEntry& entry) {
  if (std::exchange(entry.second.is_written, true)) return;
  writing_boots_.push_back(&entry);
}

asio::awaitable<void> Recorder::write() {
  if (writing_.empty()) co_return;
  auto job = [this](Database&) { return try_to_write(); };
  const std::string problem = co_await on_disk(std::move(job));
  if (!problem.empty()) {
    note_failure(problem);
    co_return;
  }
  if (failing()) spdlog::info("recording goes on: what had waited for the disk is stored");
  retry_at_us_ = 0;
  problem_.clear();
  WriteBatch written = std::exchange(writing_, {});
  for (const BootStart& start : written.boots) --by_key_.at(start.boot_key)->second.starts_waiting;
  const bool had_samples = counters_.samples_written > 0;
  count_written(written);
  if (!had_samples && counters_.samples_written > 0) checkpointer_.pass_at_once();
  co_await tell_durable(std::move(written.progress));
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

asio::awaitable<void> Recorder::finish_checkpoint() {
  if (!checkpointer_.wants_finish()) co_return;
  const CheckpointMode mode = checkpointer_.finish_mode();
  auto finish = [mode](Database& database) { return checkpoint(database.handle(), mode); };
  const CheckpointOutcome outcome = co_await on_disk(std::move(finish));
  checkpointer_.on_finish(mode, outcome);
}

void Recorder::count_written(const WriteBatch& written) {
  std::uint64_t samples = 0;
  for (const Segment& segment : written.segments) samples += segment.samples.size();
  for (const LostRange& gap : written.gaps) counters_.samples_lost += gap.lost.next - gap.lost.first;
  ++counters_.commits;
  counters_.samples_written += samples;
  counters_.largest_commit_samples = std::max(counters_.largest_commit_samples, samples);
  queued_samples_ -= samples;
}

// In turns, so that nothing else on the loop waits for all of them.
asio::awaitable<void> Recorder::tell_durable(std::vector<BootProgress> progress) {
  const std::vector<BootEntry*> written = std::exchange(writing_boots_, {});
  for (std::size_t at = 0; at < written.size(); ++at) {
    auto& [boot_id, boot] = *written[at];
    boot.is_written = false;
    boot.recording.set_durable(progress[at]);
    if (on_durable_) {
      on_durable_(boot.recording.robot_id(), boot_id, progress[at].durable_next_seq,
                  progress[at].durable_next_event_seq);
    }
    if ((at + 1) % kToldInATurn == 0) co_await asio::post(loop_, asio::use_awaitable);
  }
}

void Recorder::end_flushes() {
  std::erase_if(flushes_, [this](const Flush& flush) {
    if (!flush.is_taken || flush.after > left_line_) return false;
    if (const auto done = flush.done.lock()) done->notify();
    return true;
  });
}

// All that miss something, in turns.
asio::awaitable<void> Recorder::ask_for_missing() {
  const std::int64_t now_us = clock_.steady_us();
  const bool room_for_samples = on_missing_ && queued_samples_ <= options_.max_queued_samples / 2;
  const bool room_for_events = on_missing_events_ && queued_records() <= options_.max_queued_records / 2;
  for (std::size_t left = with_holes_.size(); left > 0; --left) {
    if (left % kBootsInATurn == 0) co_await asio::post(loop_, asio::use_awaitable);
    BootEntry& entry = *with_holes_.front();
    with_holes_.pop_front();
    auto& [boot_id, boot] = entry;
    boot.has_hole = boot.connected && boot.recording.has_hole();
    if (!boot.has_hole) continue;
    with_holes_.push_back(&entry);  // looked at again in its turn
    const RobotId& robot_id = boot.recording.robot_id();
    if (room_for_samples) {
      const auto hole = boot.recording.overdue_samples(now_us);
      if (hole) on_missing_(robot_id, boot_id, hole->first, hole->next);
    }
    if (room_for_events && boot.recording.has_overdue_events(now_us)) {
      ++counters_.events_asked_again;
      on_missing_events_(robot_id, boot_id);
    }
  }
}

}  // namespace server
