#include "server/storage/ingest/boot_registry.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "server/runtime/clock.hpp"

namespace server::storage {
using namespace std::chrono_literals;

namespace {

// A robot's samples wait at most this long for a complete segment: a second, and what frames of up to 0.25 s and late
// ones need to complete it.
constexpr microseconds kGroupAge = 1100ms;
constexpr microseconds kKeepUnused = 60s;  // a boot's bookkeeping, after its last admission
constexpr microseconds kForgetInterval = 10s;

bool is_unused(const BootEntry& boot, std::int64_t now_us) {
  const bool long_ago = boot.replaced || !boot.recording.loaded() || now_us - boot.last_used_us > kKeepUnused.count();
  return !boot.connected && boot.admissions == 0 && long_ago && !boot.is_listed();
}

}  // namespace

station::Admission another_boot_connected() {
  return refusal(rheonaut_REFUSAL_REASON_STATION_BUSY, "another boot of this robot has just connected; try again");
}

BootEntry* BootRegistry::find(station::BootId boot_id) {
  const auto found = boots_.find(boot_id);
  return found == boots_.end() ? nullptr : &found->second;
}

const BootEntry* BootRegistry::find(station::BootId boot_id) const {
  const auto found = boots_.find(boot_id);
  return found == boots_.end() ? nullptr : &found->second;
}

const BootEntry* BootRegistry::find_loaded(station::BootId boot_id) const {
  const BootEntry* boot = find(boot_id);
  return boot != nullptr && boot->recording.loaded() ? boot : nullptr;
}

BootEntry* BootRegistry::find_recorded(station::BootId boot_id) {
  BootEntry* boot = find(boot_id);
  return boot != nullptr && boot->is_recorded() ? boot : nullptr;
}

BootEntry& BootRegistry::enter(station::BootId boot_id, const station::RobotId& robot_id) {
  return boots_.try_emplace(boot_id, boot_id, robot_id).first->second;
}

bool BootRegistry::another_starts(const station::AdmissionRequest& request, std::int64_t since_us) const {
  const auto [begin, end] = by_robot_.equal_range(request.robot_id);
  return std::any_of(begin, end, [&](const auto& of_robot) {
    const BootEntry& boot = *of_robot.second;
    const bool has_just = boot.started && boot.last_used_us >= since_us;
    return boot.boot_id != request.boot_id && (boot.queued_starts > 0 || has_just);
  });
}

station::Admission BootRegistry::admit(BootEntry& boot, StoredBoot stored, station::Admission answer,
                                       const station::AdmissionRequest& request, std::int64_t now_us) {
  if (boot.replaced) return another_boot_connected();
  if (!boot.recording.loaded()) {
    load_or_number(boot, std::move(stored), request);
  } else if (boot.recording.robot_id() != request.robot_id) {  // which was admitted meanwhile
    return reused(request, boot.recording.robot_id());
  }
  if (!boot.recording.continues(request.next_seq, request.robot_time_us)) {
    return refusal(rheonaut_REFUSAL_REASON_BOOT_ID_REUSED,
                   fmt::format("boot {} was already at a later sample or time than next_seq {} and {} µs; a boot_id "
                               "must be random, new in each boot",
                               request.boot_id, request.next_seq, request.robot_time_us));
  }
  boot.last_used_us = now_us;
  boot.hello = request;
  answer.durable_next_seq = boot.recording.durable_next_seq();
  answer.durable_next_event_seq = boot.recording.durable_next_event_seq();
  return answer;
}

// One that the disk does not know is numbered here and stored with the next commit.
void BootRegistry::load_or_number(BootEntry& boot, StoredBoot stored, const station::AdmissionRequest& request) {
  if (stored.key == 0) {
    stored.key = next_boot_key_++;
    stored.next_seq = request.next_seq;
    stored.last_robot_time_us = request.robot_time_us;
    with_records_.add(boot);
  }
  load(boot, std::move(stored), request.robot_id);
}

void BootRegistry::load(BootEntry& boot, StoredBoot stored, const station::RobotId& robot_id) {
  by_robot_.emplace(robot_id, &boot);
  boot.recording = BootRecording{robot_id};
  boot.recording.load(std::move(stored));
}

BootRegistry::Started BootRegistry::start(BootEntry& boot, std::int64_t utc_us) {
  const station::AdmissionRequest hello = *std::exchange(boot.hello, {});
  boot.recording.connect(hello, restored_at_us_);
  boot.started = true;
  return {.start = {.robot_id = hello.robot_id,
                    .boot_key = boot.recording.key(),
                    .announced_next_seq = hello.next_seq,
                    .announced_next_event_seq = hello.next_event_seq,
                    .robot_time_us = hello.robot_time_us,
                    .noticed_at_us = hello.received_at_us},
          .replaced = replace_others(boot, utc_us)};
}

std::vector<BootEntry*> BootRegistry::replace_others(const BootEntry& boot, std::int64_t utc_us) {
  std::vector<BootEntry*> others;
  const auto [begin, end] = by_robot_.equal_range(boot.recording.robot_id());
  for (auto of_robot = begin; of_robot != end; ++of_robot) {
    BootEntry& other = *of_robot->second;
    if (&other == &boot || other.recording.connected_at_us() == 0) continue;
    replace(other, utc_us);
    others.push_back(&other);
  }
  return others;
}

void BootRegistry::replace(BootEntry& boot, std::int64_t utc_us) {
  const char* cause = boot.recording.connected_at_us() < restored_at_us_ ? "restore" : "reboot";
  boot.connected = false;
  replaced_ += boot.replaced ? 0 : 1;
  boot.replaced = true;
  boot.recording.set_lost_below(boot.recording.next_seq(), cause, utc_us);
  boot.recording.set_events_lost_below(boot.recording.next_event_seq(), cause, utc_us);
}

void BootRegistry::watch(BootEntry& boot) {
  const BootRecording& recording = boot.recording;
  const bool waits = !recording.waiting().empty();
  if (recording.has_complete() || (waits && !boot.connected)) due_.add(boot);
  if (waits) ageing_.add(boot, recording.waiting_since_us() + kGroupAge.count());
  if (recording.has_records()) with_records_.add(boot);
  if (boot.connected && recording.has_hole()) with_holes_.add(boot);
}

// One whose oldest samples were enqueued meanwhile is listed anew, by the age of what waits now.
BootEntry* BootRegistry::take_aged(std::int64_t now_us) {
  while (BootEntry* boot = ageing_.take_due(now_us)) {
    const bool is_old = now_us - boot->recording.waiting_since_us() >= kGroupAge.count();
    if (is_old && !boot->recording.waiting().empty()) return boot;
    watch(*boot);
  }
  return nullptr;
}

BootEntry* BootRegistry::next_with_holes() {
  BootEntry* boot = with_holes_.take_first();
  if (boot == nullptr || !boot->connected || !boot->recording.has_hole()) return nullptr;
  with_holes_.add(*boot);
  return boot;
}

void BootRegistry::forget_unused(std::int64_t now_us) {
  if (replaced_ == 0 && !forget_at_once_ && now_us < next_forget_us_) return;
  forget_at_once_ = false;
  next_forget_us_ = now_us + kForgetInterval.count();
  std::erase_if(boots_, [this, now_us](const auto& entry) {
    const BootEntry& boot = entry.second;
    if (!is_unused(boot, now_us)) return false;
    forget(boot);
    return true;
  });
}

void BootRegistry::forget(const BootEntry& boot) {
  const auto [begin, end] = by_robot_.equal_range(boot.recording.robot_id());
  const auto found = std::find_if(begin, end, [&boot](const auto& other) { return other.second == &boot; });
  if (found != end) by_robot_.erase(found);
  replaced_ -= boot.replaced ? 1 : 0;
}

}  // namespace server::storage
