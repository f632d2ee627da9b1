// Sessions between two cuts; what happens in them is in station_life_acts.cpp.
#include "tests/server/recording/station_life.hpp"

#include <fmt/format.h>

namespace server {
namespace {

constexpr std::array<const char*, 3> kRobotNames{"nemo", "dory", "bruce"};
constexpr int kPatience = 40;  // rounds until everything that robots hold must be durable

}  // namespace

StationLife::StationLife(unsigned seed, Mutant mutant)
    : seed_{seed}, mutant_{mutant}, random_{seed}, survival_{static_cast<Survival>(random_() % 3)} {
  for (const char* name : kRobotNames) {
    RingRobot& robot = robots_.emplace_back();
    robot.own.id = name;
    start_boot(robot);
  }
}

StationLife::~StationLife() { kill(); }

Faults StationLife::live(int cuts) {
  while (static_cast<int>(cuts_.size()) < cuts && faults_.empty()) live_until_cut();
  if (faults_.empty()) end_well();
  return faults_;
}

void StationLife::note(const Faults& faults, const char* when) {
  for (const std::string& fault : faults) {
    faults_.push_back(fmt::format("seed {}, survives: {}, {} after cuts {} [{}]: {}", seed_, text(survival_), when,
                                  cuts_.size(), fmt::join(cuts_, ", "), fault));
  }
}

void StationLife::live_until_cut() {
  // Barriers are most of the calls, so only every fourth cut may be at one.
  const bool at_barriers = pick(4) == 0;
  vfs_.begin(survival_, 1 + pick(pick(3) == 0 ? 50 : 300), at_barriers);
  try {
    begin();
    while (!vfs_.has_failed() && faults_.empty()) act();
  } catch (const std::exception& error) {  // the station cannot be opened, or work on the disk failed
    if (!vfs_.has_failed()) note({error.what()}, "while the power is on");
  }
  kill();
  for (RingRobot& robot : robots_) robot.is_connected = false;
  if (!vfs_.has_failed()) return;  // a fault ended it
  const bool only_killed = pick(4) == 0;
  cuts_.push_back((only_killed ? "kill in " : "") + vfs_.failed_call());
  if (!only_killed) {
    vfs_.lose_power(random_);
    std::filesystem::remove_all(storage::kept_folder_of(path_));  // names that were never synced
  }
  for (RingRobot& robot : robots_) {  // time passes until the station is back
    if (pick(4) == 0) reboot(robot);
    make_samples(robot, pick(pick(4) == 0 ? 400 : 40));
    if (pick(3) == 0) make_event(robot);
  }
}

void StationLife::begin() {
  storage::RecorderOptions options;
  options.checkpoint_bytes = (5 + pick(60)) * 4096;
  options.head_interval = 100ms;
  start(options);
  for (const storage::StoreLoss& loss : recording_->head_watch.losses()) note({loss.problem}, "at the next start");
  recorder_->set_on_durable([this](const station::RobotId&, station::BootId boot_id, std::uint64_t next_seq,
                                   std::uint64_t next_event) { acknowledge(boot_id, next_seq, next_event); });
  recorder_->set_on_missing([this](const station::RobotId&, station::BootId boot_id, std::uint64_t first_seq,
                                   std::uint64_t next_seq) { asked_[boot_id].push_back({first_seq, next_seq}); });
  recorder_->set_on_missing_events(
      [this](const station::RobotId&, station::BootId boot_id) { asked_events_.insert(boot_id); });
  moving_commands_.clear();
  station_events_.clear();
  open_run_.reset();
  auto job = [without_sync = mutant_ == Mutant::synchronous_off](storage::Database& database) {
    if (without_sync) database.handle().exec("PRAGMA synchronous = OFF");
  };
  wait(recorder_->on_disk(std::move(job)));
  SQLite::Database database = storage::open_for_reading(path_);
  note(audit(database, truth_), "at the next start");
  check_stops();
  for (RingRobot& robot : robots_) {
    if (pick(5) > 0) join(robot);
  }
}

// An emergency stop that was accepted is known until a robot has acknowledged it.
void StationLife::check_stops() {
  for (const auto& [id, command] : truth_.commands) {
    if (!command.is_stop || !command.flushed || command.latest == station::CommandState::acknowledged) continue;
    if (std::ranges::find(restored_.pending_stops, id, &station::CommandRecord::id) == restored_.pending_stops.end()) {
      note({fmt::format("stop {} is not pending", id)}, "at the next start");
    }
  }
}

void StationLife::end_well() {
  const auto compare = [this](const char* when) {
    SQLite::Database database = storage::open_for_reading(path_);
    note(audit_complete(database, truth_), when);
  };
  try {
    vfs_.begin(survival_, 0);
    begin();
    for (RingRobot& robot : robots_) send_the_rest(robot);
    compare("at the end");
    stop();
    compare("after the end");
  } catch (const std::exception& error) {  // such as a file that is malformed
    note({error.what()}, "at the end");
  }
}

void StationLife::send_the_rest(RingRobot& robot) {
  const BootTruth& truth = truth_.boots.at(robot.own.boot_id);
  if (robot.is_connected) leave(robot);
  make_samples(robot, 1);
  make_event(robot);
  join(robot);  // tells how far it has come; the station asks for the rest
  for (int round = 0; round < kPatience; ++round) {
    if (truth.acknowledged == truth.made && truth.events_acknowledged == truth.events_made) return;
    clock_.run_for(500ms);
    answer_missing();
  }
  note({fmt::format("of robot '{}' only {} samples of {} and {} events of {} become durable", robot.own.id,
                    truth.acknowledged, truth.made, truth.events_acknowledged, truth.events_made)},
       "at the end");
}

}  // namespace server
