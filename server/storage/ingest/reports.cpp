// What the station reports to the recorder: each goes to its boot, or into the queue.
#include <spdlog/spdlog.h>

#include "server/station/state/checked.hpp"
#include "server/storage/ingest/boot_registry.hpp"
#include "server/storage/ingest/commit_queue.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::storage {
using namespace std::chrono_literals;

namespace {

constexpr microseconds kOverflowLogInterval = 10s;

}  // namespace

void Recorder::on_robot(const station::RobotState& robot) {
  BootEntry* boot = boots_->find(robot.boot_id);
  if (boot == nullptr || boot->recording.robot_id() != robot.id) return;
  boot->connected = robot.link == station::LinkState::connected && !boot->replaced;
  if (boot->connected && boot->hello) start(*boot);
  watch(*boot);
}

void Recorder::start(BootEntry& boot) {
  BootRegistry::Started started = boots_->start(boot, clock_.utc_us());
  for (BootEntry* replaced : started.replaced) {
    queue_->enqueue_segments(*replaced, true);
    watch(*replaced);
  }
  queue_->enqueue_start(boot, std::move(started.start));
  note_returned(boot);
}

void Recorder::on_samples(const station::RobotState& robot, const station::SampleBatch& batch) {
  BootEntry* boot = boots_->find_recorded(batch.boot_id);
  if (boot == nullptr) {
    ++counters_.batches_malformed;
    return;
  }
  const std::size_t added = boot->recording.count_new(batch);
  counters_.samples_duplicate += batch.samples.size() - added - boot->recording.count_given_up(batch);
  if (queue_->has_room_for_samples(added)) {
    boot->recording.append(batch, robot.latest_robot_time_us, clock_.steady_us());
    queue_->count_received(added);
  } else {
    boot->recording.refuse(batch);
    note_refused(added);
  }
  boot->recording.set_lost_below(batch.oldest_seq, "ring_overrun", batch.received_at_us);
  watch(*boot);
}

void Recorder::note_refused(std::size_t samples) {
  counters_.samples_refused += samples;
  const std::int64_t now_us = clock_.steady_us();
  if (now_us - overflow_logged_us_ < kOverflowLogInterval.count()) return;
  overflow_logged_us_ = now_us;
  spdlog::warn("the disk does not keep up: {} samples wait, {} were refused so far and will be asked for again",
               queue_->samples(), counters_.samples_refused);
}

void Recorder::on_unusable_samples(const station::RobotState& robot, std::uint64_t first_seq, std::uint64_t next_seq) {
  ++counters_.batches_malformed;
  BootEntry* boot = boots_->find_recorded(robot.boot_id);
  if (boot == nullptr) return;
  boot->recording.set_lost({first_seq, next_seq}, "invalid", robot.last_received_at_us);
  watch(*boot);
}

void Recorder::on_unusable_event(const station::RobotState& robot, std::uint64_t event_seq) {
  BootEntry* boot = boots_->find_recorded(robot.boot_id);
  if (boot == nullptr) return;
  boot->recording.set_event_lost(event_seq, "invalid", robot.last_received_at_us);
  watch(*boot);
}

void Recorder::on_event_left_out(const station::RobotState& robot, std::uint64_t event_seq) {
  BootEntry* boot = boots_->find_recorded(robot.boot_id);
  if (boot == nullptr) return;
  boot->recording.set_event_lost(event_seq, "too_many", robot.last_received_at_us);
  watch(*boot);
}

// SAFETY: whatever waits, since its limits must hold after a restart. One entry for each robot at most.
void Recorder::on_fluid(const station::RobotState& robot) {
  queue_->set_fluid(robot.id, robot.fluid);
  wake();
}

void Recorder::on_event(const station::RobotState&, const station::RobotEvent& event) {
  BootEntry* boot = boots_->find_recorded(event.boot_id);
  if (!event.event_seq && is_of_interruption(event)) return record_interruption(event);
  if (!event.event_seq) {
    if (!room_for_record()) return;
    queue_->enqueue(StoredEvent{boot == nullptr ? 0 : boot->recording.key(), event});
    return wake();
  }
  if (boot == nullptr) return;
  if (!room_for_record()) {
    boot->recording.refuse_event(*event.event_seq);
  } else if (boot->recording.append_event(*event.event_seq)) {
    queue_->enqueue(StoredEvent{boot->recording.key(), event});
  }
  boot->recording.set_events_lost_below(event.oldest_event_seq, "ring_overrun", event.received_at_us);
  watch(*boot);
}

// Of a boot that has been replaced, too: that is how such a wait may end. Nobody sends it again, and without it a fit
// takes the wait for motion.
void Recorder::record_interruption(const station::RobotEvent& event) {
  const BootEntry* boot = boots_->find_loaded(event.boot_id);
  if (!queue_->has_room_for_interruption() && !room_for_record()) return;
  queue_->enqueue_interruption(StoredEvent{boot == nullptr ? 0 : boot->recording.key(), event});
  wake();
}

void Recorder::on_command(const station::CommandRecord& command) {
  enqueue(renewals_.take(command, clock_.steady_us()));
  wake();
}

void Recorder::enqueue(const Renewals::Records& commands) {
  for (const station::CommandRecord& command : commands) {
    if (queue_->replace(command)) continue;
    // SAFETY: a stop must be known after a restart, so it is recorded whatever waits.
    if (command.kind == "emergency_stop" || room_for_record()) {
      queue_->enqueue(command);
    } else {
      quota_.leave_out("command");
    }
  }
}

void Recorder::on_audit(const station::AuditNote& note) {
  wake();
  if (note.can_flood && !quota_.take(note.action, clock_.steady_us())) return;
  if (!room_for_record()) return quota_.leave_out(note.action);
  queue_->enqueue(note);
}

void Recorder::on_clock(const station::RobotState&, const station::ClockRecord& record) {
  const std::int64_t boot_key = key_of(record.boot_id);
  if (boot_key == 0 || !room_for_record()) return;
  queue_->enqueue(StoredClock{boot_key, record});
  wake();
}

void Recorder::on_in_force(const station::RobotState&, const station::InForceRecord& record) {
  const std::int64_t boot_key = key_of(record.boot_id);
  if (boot_key == 0 || record.first_seq > station::kMaxRobotNumber || !room_for_record()) return;
  queue_->enqueue(StoredInForce{boot_key, record});
  wake();
}

// 0 unless samples of the boot are recorded now.
std::int64_t Recorder::key_of(station::BootId boot_id) const {
  const BootEntry* boot = boots_->find_recorded(boot_id);
  return boot == nullptr ? 0 : boot->recording.key();
}

bool Recorder::room_for_record() {
  if (queue_->has_room_for_record()) return true;
  if (counters_.records_refused++ == 0)
    spdlog::error("the disk does not keep up: commands are not recorded, events are asked for again");
  return false;
}

}  // namespace server::storage
