// Robots and boots that the recorder takes in: the disk is asked who they are, and the memory what they are doing.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/runtime/counted.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kKeepUnused = 60s;  // a boot's bookkeeping, after its last admission
constexpr microseconds kForgetInterval = 10s;

constexpr auto kAnotherConnected = "another boot of this robot has just connected; try again";

Admission refused(protocol::RefusalReason reason, std::string detail) {
  Admission admission;
  admission.refusal = reason;
  admission.detail = std::move(detail);
  return admission;
}

}  // namespace

asio::awaitable<Admission> Recorder::admit(AdmissionRequest request) {
  if (request.next_seq >= kMaxRecordedNumber || request.oldest_seq > request.next_seq ||
      request.next_event_seq >= kMaxRecordedNumber || request.robot_time_us >= kMaxRecordedNumber) {
    co_return refused(rheonaut_REFUSAL_REASON_MALFORMED,
                      fmt::format("oldest_seq {}, next_seq {}, next_event_seq {} and robot time {} µs cannot be",
                                  request.oldest_seq, request.next_seq, request.next_event_seq, request.robot_time_us));
  }
  BootEntry& entry = *boots_.try_emplace(request.boot_id, request.robot_id).first;
  const Counted admitting{entry.second.admissions};  // keeps the boot, whatever happens
  wake();
  std::optional<RobotId> owner;
  if (entry.second.recording.loaded()) owner = entry.second.recording.robot_id();
  AdmissionQuestion question{request, std::move(owner)};
  const std::int64_t asked_us = clock_.steady_us();
  bool is_ending = another_starts(request, asked_us);
  AdmissionOutcome outcome = co_await ask(std::move(question));
  is_ending = is_ending || another_starts(request, asked_us);
  const bool is_stored = outcome.boot.key != 0;
  Admission admission = is_stored && is_ending ? refused(rheonaut_REFUSAL_REASON_STATION_BUSY, kAnotherConnected)
                                               : take_in(entry, std::move(outcome), request);
  const bool was_known = entry.second.recording.loaded() || entry.second.admissions > 1;
  forget_at_once_ = forget_at_once_ || !was_known;  // who is refused leaves nothing behind
  co_return admission;
}

// Another boot of this robot has connected, and that was not stored at that time: what was read of any other boot
// since, may be what it was before it ended.
bool Recorder::another_starts(const AdmissionRequest& request, std::int64_t since_us) const {
  const auto [begin, end] = by_robot_.equal_range(request.robot_id);
  return std::any_of(begin, end, [&](const auto& of_robot) {
    const auto& [boot_id, boot] = *of_robot.second;
    const bool has_just = boot.started && boot.last_used_us >= since_us;
    return boot_id != request.boot_id && (boot.starts_waiting > 0 || has_just);
  });
}

// Those who asked while the disk was busy are answered together: a thousand new robots are not a thousand commits. One
// of them asks for all that are there; when it has ended, whatever came of it, another one asks for those that came
// later.
asio::awaitable<AdmissionOutcome> Recorder::ask(AdmissionQuestion question) {
  const auto mine = std::make_shared<Asked>(loop_, std::move(question));
  asked_.push_back(mine);
  while (!mine->outcome) {
    if (is_asking_) {
      co_await mine->told.wait();
      continue;
    }
    const AskingTurn turn{*this};
    std::vector<AdmissionQuestion> questions;
    for (const auto& asked : asked_) questions.push_back(asked->question);
    auto job = [questions = std::move(questions), enrol = options_.enrolment](Database& database) {
      return BootStore{database}.admit(questions, enrol);
    };
    auto outcomes = co_await on_disk(std::move(job));
    for (AdmissionOutcome& outcome : outcomes) {
      asked_.front()->outcome = std::move(outcome);
      asked_.front()->told.notify();
      asked_.pop_front();
    }
  }
  co_return std::move(*mine->outcome);
}

Recorder::AskingTurn::~AskingTurn() {
  recorder.is_asking_ = false;
  for (const auto& asked : recorder.asked_) asked->told.notify();
}

void Recorder::set_revoked(const RobotId& robot_id, bool revoked) {
  revoked ? static_cast<void>(revoked_.insert(robot_id)) : static_cast<void>(revoked_.erase(robot_id));
}

Admission Recorder::take_in(BootEntry& entry, AdmissionOutcome outcome, const AdmissionRequest& request) {
  Boot& boot = entry.second;
  Admission& admission = outcome.admission;
  if (admission.refusal != rheonaut_REFUSAL_REASON_NONE) return admission;
  if (revoked_.contains(request.robot_id)) return revoked(request.robot_id);  // since the disk was asked
  if (admission.newly_enrolled) {
    spdlog::info("robot '{}' enrolled from loopback {} a token", request.robot_id,
                 request.token.empty() ? "without" : "with");
  }
  if (boot.replaced) {
    return refused(rheonaut_REFUSAL_REASON_STATION_BUSY, kAnotherConnected);
  }
  if (!boot.recording.loaded()) {
    if (outcome.boot.key == 0 && queue_.new_boots.size() >= options_.max_queued_records) {
      return refused(rheonaut_REFUSAL_REASON_STATION_BUSY, "too many new boots wait for the disk; try again");
    }
    add_boot(entry, std::move(outcome.boot), request);
  } else if (boot.recording.robot_id() != request.robot_id) {  // which was admitted meanwhile
    return reused(request, boot.recording.robot_id());
  }
  if (!boot.recording.continues(request.next_seq, request.robot_time_us)) {
    return refused(rheonaut_REFUSAL_REASON_BOOT_ID_REUSED,
                   fmt::format("boot {} was already at a later sample or time than next_seq {} and {} µs; a boot_id "
                               "must be random, new in each boot",
                               request.boot_id, request.next_seq, request.robot_time_us));
  }
  boot.last_used_us = clock_.steady_us();
  boot.hello = request;
  admission.durable_next_seq = boot.recording.durable_next_seq();
  admission.durable_next_event_seq = boot.recording.durable_next_event_seq();
  return admission;
}

// One that the disk does not know is numbered here and stored with the next commit.
void Recorder::add_boot(BootEntry& entry, StoredBoot stored, const AdmissionRequest& request) {
  Boot& boot = entry.second;
  if (stored.key == 0) {
    stored.key = next_boot_key_++;
    stored.next_seq = request.next_seq;
    stored.last_robot_time_us = request.robot_time_us;
    queue_.new_boots.push_back({stored.key, request});
    boot.has_records = true;
    with_records_.push_back(&entry);
  }
  by_key_.emplace(stored.key, &entry);
  by_robot_.emplace(request.robot_id, &entry);
  boot.recording = BootRecording{request.robot_id};
  boot.recording.load(std::move(stored));
}

bool Recorder::is_unused(const Boot& boot) const {
  const bool long_ago =
      boot.replaced || !boot.recording.loaded() || clock_.steady_us() - boot.last_used_us > kKeepUnused.count();
  const bool is_listed =
      boot.is_due || boot.is_ageing || boot.has_records || boot.has_hole || boot.is_written || boot.starts_waiting > 0;
  return !boot.connected && boot.admissions == 0 && long_ago && !is_listed && boot.in_line == 0;
}

void Recorder::forget_unused() {
  const std::int64_t now_us = clock_.steady_us();
  if (replaced_boots_ == 0 && !forget_at_once_ && now_us < next_forget_us_) return;
  forget_at_once_ = false;
  next_forget_us_ = now_us + kForgetInterval.count();
  std::erase_if(boots_, [this](const BootEntry& entry) {
    const Boot& boot = entry.second;
    if (!is_unused(boot)) return false;
    by_key_.erase(boot.recording.key());
    const auto [begin, end] = by_robot_.equal_range(boot.recording.robot_id());
    const auto found = std::find_if(begin, end, [&entry](const auto& other) { return other.second == &entry; });
    if (found != end) by_robot_.erase(found);
    replaced_boots_ -= boot.replaced ? 1 : 0;
    return true;
  });
}

}  // namespace server
