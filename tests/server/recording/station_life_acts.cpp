// What robots, people and the machine do to the station while the power is on.
#include <boost/asio/awaitable.hpp>

#include "tests/server/recording/station_life.hpp"

namespace server {
namespace {

constexpr std::uint64_t kRingSamples = 300;
constexpr std::uint64_t kRingEvents = 12;
constexpr std::uint64_t kFrameSamples = 25;

}  // namespace

void StationLife::act() {
  RingRobot& robot = robots_[pick(robots_.size())];
  switch (pick(18)) {
    case 0:
    case 1:
    case 2: clock_.run_for(microseconds{pick(400'000)}); break;
    case 3:
    case 4:
    case 5:
    case 6: make_samples(robot, 1 + pick(60)); break;
    case 7:
    case 8: {
      const std::uint64_t first = robot.own.oldest_seq + pick(robot.own.next_seq - robot.own.oldest_seq);
      send_held(robot, first, 1 + pick(60));
      break;
    }
    case 9: make_event(robot); break;
    case 10:
    case 11: make_record(); break;
    case 12: flush_records(); break;
    case 13: robot.is_connected ? leave(robot) : join(robot); break;
    case 14:
      if (pick(3) == 0) reboot(robot);
      if (!robot.is_connected) join(robot);
      break;
    case 15: robot.own.context.setpoint_m = static_cast<float>(pick(3)); break;
    case 16: care_for_database(); break;
    default: make_or_end_run(robot);
  }
  answer_missing();
}

// Most frames arrive; the others are made up for later.
void StationLife::make_samples(RingRobot& robot, std::uint64_t count) {
  while (count > 0) {
    const std::uint64_t first = robot.own.next_seq;
    const std::uint64_t size = std::min(count, 1 + pick(kFrameSamples));
    robot.own.next_seq += size;
    truth_.boots.at(robot.own.boot_id).made = robot.own.next_seq;
    let_go(robot);
    if (pick(6) > 0) send_held(robot, first, size);
    count -= size;
  }
}

void StationLife::send_held(const RingRobot& robot, std::uint64_t first_seq, std::uint64_t count) {
  if (!robot.is_connected) return;
  const TestRobot& own = robot.own;
  const std::uint64_t next_seq = std::min(first_seq + count, own.next_seq);
  for (std::uint64_t seq = std::max(first_seq, own.oldest_seq); seq < next_seq; seq += kFrameSamples) {
    station::SampleBatch batch = own.batch(seq, std::min(kFrameSamples, next_seq - seq));
    for (station::Sample& sample : batch.samples) sample.impedance_mv = truth_.boots.at(own.boot_id).impedance_mv;
    send(own, batch);
    received_[own.boot_id].insert({batch.first_seq, batch.next_seq()});
  }
  if (mutant_ == Mutant::acknowledges_on_reception) acknowledge(own.boot_id, received_[own.boot_id].first_hole(), 0);
}

void StationLife::answer_missing() {
  const std::map<station::BootId, std::vector<Missing>> asked = std::exchange(asked_, {});
  const std::set<station::BootId> asked_events = std::exchange(asked_events_, {});
  for (const RingRobot& robot : robots_) {
    if (asked_events.contains(robot.own.boot_id)) send_held_events(robot);
    const auto found = asked.find(robot.own.boot_id);
    if (found == asked.end()) continue;
    for (const Missing& range : found->second) {
      send_held(robot, range.first_seq, range.next_seq - range.first_seq);
    }
  }
}

void StationLife::make_event(RingRobot& robot) {
  const std::uint64_t event_seq = robot.next_event_seq++;
  truth_.boots.at(robot.own.boot_id).events_made = robot.next_event_seq;
  let_go(robot);
  if (pick(6) > 0) send_event(robot, event_seq);
}

void StationLife::send_held_events(const RingRobot& robot) {
  for (std::uint64_t seq = robot.oldest_event_seq; seq < robot.next_event_seq; ++seq) send_event(robot, seq);
}

void StationLife::send_event(const RingRobot& robot, std::uint64_t event_seq) {
  if (!robot.is_connected) return;
  station::RobotEvent event;
  event.robot_id = robot.own.id;
  event.boot_id = robot.own.boot_id;
  event.event_seq = event_seq;
  event.oldest_event_seq = robot.oldest_event_seq;
  event.kind = "mode_changed";
  event.cause = "command";
  event.value = static_cast<float>(event_seq);
  recorder_->on_event(state_of(robot.own, station::LinkState::connected), event);
}

// What does not fit into the ring any more was neither acknowledged nor can it be sent again.
void StationLife::let_go(RingRobot& robot) {
  BootTruth& truth = truth_.boots.at(robot.own.boot_id);
  const auto drop = [](std::uint64_t next, std::uint64_t capacity, std::uint64_t& oldest,
                       storage::IntervalSet& dropped) {
    if (next <= oldest + capacity) return;
    dropped.insert({oldest, next - capacity});
    oldest = next - capacity;
  };
  drop(robot.own.next_seq, kRingSamples, robot.own.oldest_seq, truth.let_go);
  drop(robot.next_event_seq, kRingEvents, robot.oldest_event_seq, truth.events_let_go);
}

// The robot is told, believes it and forgets.
void StationLife::acknowledge(station::BootId boot_id, std::uint64_t next_seq, std::uint64_t next_event_seq) {
  BootTruth& truth = truth_.boots.at(boot_id);
  truth.acknowledged = std::max(truth.acknowledged, next_seq);
  truth.events_acknowledged = std::max(truth.events_acknowledged, next_event_seq);
  for (RingRobot& robot : robots_) {
    if (robot.own.boot_id != boot_id) continue;
    robot.own.oldest_seq = std::max(robot.own.oldest_seq, truth.acknowledged);
    robot.oldest_event_seq = std::max(robot.oldest_event_seq, truth.events_acknowledged);
  }
}

void StationLife::start_boot(RingRobot& robot) {
  robot.own.boot_id = (static_cast<station::BootId>(random_()) << 32) | (truth_.boots.size() + 1);
  robot.own.next_seq = robot.own.oldest_seq = 0;
  robot.next_event_seq = robot.oldest_event_seq = 0;
  BootTruth& truth = truth_.boots[robot.own.boot_id];
  truth.robot_id = robot.own.id;
  truth.impedance_mv = static_cast<float>(truth_.boots.size());
}

void StationLife::reboot(RingRobot& robot) {
  const bool was_connected = robot.is_connected;
  if (was_connected) leave(robot);
  BootTruth& truth = truth_.boots.at(robot.own.boot_id);
  truth.let_go.insert({robot.own.oldest_seq, robot.own.next_seq});
  truth.events_let_go.insert({robot.oldest_event_seq, robot.next_event_seq});
  truth.ended = true;
  start_boot(robot);
  if (was_connected) join(robot);
}

void StationLife::join(RingRobot& robot) {
  robot.own.next_event_seq = robot.next_event_seq;
  const station::Admission admission = admit(robot.own);
  if (admission.refusal == rheonaut_REFUSAL_REASON_STATION_BUSY) return;
  if (admission.refusal != rheonaut_REFUSAL_REASON_NONE) return note({admission.detail}, "at a connection");
  if (truth_.store_id == 0) truth_.store_id = admission.store_id;
  if (truth_.store_id != admission.store_id) note({"another store_id"}, "at a connection");
  acknowledge(robot.own.boot_id, admission.durable_next_seq, admission.durable_next_event_seq);
  const station::RobotState state = state_of(robot.own, station::LinkState::connected);
  recorder_->on_robot(state);
  runs_->on_robot(state);
  robot.is_connected = true;
  if (pick(4) > 0) send_held_events(robot);
  if (pick(2) == 0) send_held(robot, robot.own.oldest_seq, kRingSamples);
}

void StationLife::leave(RingRobot& robot) {
  disconnect(robot.own);
  robot.is_connected = false;
}

// A command, the next state of one, or an event of the station.
void StationLife::make_record() {
  if (pick(3) == 0) {
    station::RobotEvent event;
    event.robot_id = robots_.front().own.id;
    event.sample_seq = ++last_station_event_;
    event.kind = "connected";
    recorder_->on_event({}, event);
    station_events_.insert(last_station_event_);
    return;
  }
  const bool is_new = moving_commands_.empty() || pick(2) == 0;
  const station::CommandId id = is_new ? ++last_command_id_ : moving_commands_[pick(moving_commands_.size())];
  CommandTruth& truth = truth_.commands[id];
  if (is_new) {
    truth.is_stop = pick(2) == 0;
    moving_commands_.push_back(id);
  } else if (truth.latest < station::CommandState::acknowledged) {
    truth.latest = static_cast<station::CommandState>(static_cast<int>(truth.latest) + 1);
  }
  station::CommandRecord command;
  command.id = id;
  command.robot_id = robots_.front().own.id;
  command.kind = truth.is_stop ? "emergency_stop" : "set_duty";
  command.state = truth.latest;
  recorder_->on_command(command);
}

void StationLife::flush_records() {
  if (!wait(recorder_->flush_records())) return;
  for (const station::CommandId id : moving_commands_) truth_.commands[id].flushed = truth_.commands[id].latest;
  truth_.station_events.merge(station_events_);
  station_events_.clear();
}

void StationLife::make_or_end_run(const RingRobot& robot) try {
  if (open_run_) {
    wait(runs_->end(*std::exchange(open_run_, {}), "good"));
    return;
  }
  const Result<Run> run = wait(runs_->create(robot.own.id, named("a run")));
  if (!run) return;
  open_run_ = run->id;
  truth_.runs.insert(run->id);
} catch (const SQLite::Exception&) {  // the answer is an error: nobody was told that there is a run
}

void StationLife::care_for_database() {
  constexpr std::array<const char*, 4> kCheckpoints{"PASSIVE", "FULL", "RESTART", "TRUNCATE"};
  switch (pick(4)) {
    case 0: vfs_.refuse_writes(static_cast<unsigned>(1 + pick(6))); break;
    case 1: restart(); break;
    default: {
      const std::string sql = std::string{"PRAGMA wal_checkpoint("} + kCheckpoints[pick(kCheckpoints.size())] + ")";
      auto job = [sql](storage::Database& database) {
        try {
          database.handle().exec(sql);
        } catch (const SQLite::Exception&) {  // the disk is full: the log stays longer
        }
      };
      wait(recorder_->on_disk(std::move(job)));
    }
  }
}

// SIGTERM and a new start, with or without room for the last commit.
void StationLife::restart() {
  for (RingRobot& robot : robots_) {
    if (robot.is_connected) leave(robot);
  }
  stop();
  vfs_.refuse_writes(0);
  begin();
}

}  // namespace server
