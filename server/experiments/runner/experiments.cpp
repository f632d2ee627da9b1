// The queue: which experiment may begin, what it waits for, and what is left of it at its end.
#include "server/experiments/runner/experiments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "server/experiments/limits_check.hpp"
#include "server/storage/experiments/experiment_store.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using storage::Experiment;
using storage::ExperimentId;
using storage::ExperimentState;

namespace {

constexpr microseconds kLookAtQueues = 200ms;
constexpr microseconds kPublishEvery = 1s;
constexpr microseconds kUnusedFor = 3s;   // by people, before an experiment begins by itself
constexpr microseconds kRestBefore = 5s;  // the slot of somebody else

// What keeps one experiment from its beginning and no other one behind it.
constexpr std::array<std::string_view, 7> kLetsOthersGo{"held",         "nobody_present",         "control_of_another",
                                                        "unreadable",   "unattended_not_allowed", "reserved",
                                                        "reserved_soon"};

bool comes_before(const Experiment& a, const Experiment& b) {
  if (a.request.priority != b.request.priority) return a.request.priority > b.request.priority;
  return a.place < b.place;
}

void give_reason(Experiment& experiment, const Abort* why) {  // null: it has none
  experiment.reason = why == nullptr ? "" : why->reason;
  experiment.detail = why == nullptr ? "" : why->detail;
}

}  // namespace

Experiments::Experiments(const DriverParts& parts, storage::RecordingParts& recording, runtime::WorkerThread& maths,
                         const config::ExperimentRules& rules)
    : parts_{parts.loop, parts.clock, parts.tasks, parts.station, std::chrono::seconds{rules.back_within_s}},
      recording_{recording},
      maths_{maths},
      allow_unattended_{rules.allow_unattended},
      writer_{parts.loop, parts.clock, recording.recorder},
      rests_{parts.clock, parts.tasks, parts.station, writer_},
      wake_{parts.loop},
      changed_{parts.loop} {
  parts.station.add_sink(*this);
}

Experiments::~Experiments() = default;

asio::awaitable<void> Experiments::run() {
  co_await load();
  std::int64_t published_us = 0;
  for (;;) {
    for (const auto& [robot, id] : running_) abort_if_reserved(robot);
    hold_what_is_left_alone();
    begin_what_may();
    note_states();
    const std::int64_t now_us = parts_.clock.steady_us();
    if (now_us - published_us >= kPublishEvery.count()) {
      published_us = now_us;
      for (const auto& [robot, id] : running_) publish(entries_.at(id));
    }
    co_await wake_.wait_until(parts_.clock, now_us + kLookAtQueues.count());
  }
}

// What it throws ends the task alone.
void Experiments::spawn(const std::string& name, asio::awaitable<void> task) {
  parts_.tasks.spawn(name, runtime::contained(parts_.tasks.exceptions(), parts_.clock, runtime::Ended::experiment, name,
                                              std::move(task)));
}

// --- what may begin ---

std::vector<Experiments::Entry*> Experiments::queue_of(const station::RobotId& robot_id) {
  std::vector<Entry*> queue;
  for (auto& [id, entry] : entries_) {
    const bool waits = entry.experiment.state == ExperimentState::waiting && !entry.conduct;
    if (waits && entry.experiment.request.robot_id == robot_id) queue.push_back(&entry);
  }
  std::ranges::sort(queue, [](const Entry* a, const Entry* b) { return comes_before(a->experiment, b->experiment); });
  return queue;
}

Experiments::WaitReason Experiments::wait_reason_of(const Entry& entry) const {
  const Experiment& experiment = entry.experiment;
  const station::RobotState* robot = parts_.station.find(experiment.request.robot_id);
  if (experiment.is_held) return {"held", "it waits until somebody resumes it: " + experiment.reason};
  if (running_.contains(experiment.request.robot_id)) return {"another_experiment", "another one runs on this robot"};
  if (robot == nullptr || robot->link != station::LinkState::connected || !robot->sample) {
    return {"robot_not_connected", "the robot is not connected"};
  }
  // SAFETY: the duties of a profile are counted in ticks; with longer ones the motor would be on for longer.
  if (robot->sample_period_us != kTickUs) {
    return {"sample_period", fmt::format("the robot has a sample period of {} µs, and experiments are for {} µs",
                                         robot->sample_period_us, kTickUs)};
  }
  if (entry.is_unreadable) return {"unreadable", "this version cannot read its profile; cancel it"};
  // SAFETY: the administrator may have changed their mind since it was queued.
  if (experiment.request.is_unattended && !allow_unattended_) {
    return {"unattended_not_allowed", "the station's configuration does not allow unattended experiments"};
  }
  if (WaitReason reserved = reserved_for_another(experiment); !reserved.reason.empty()) return reserved;
  if (robot->latched()) return {"emergency", "the robot is in emergency"};
  if (!is_at_rest(*robot)) return {"robot_not_at_rest", "the robot is not in manual at duty 0"};
  const std::string holder = parts_.station.holder(robot->id);
  if (!holder.empty() && holder != experiment.acts_for) return {"control_of_another", "control is with " + holder};
  // SAFETY: nothing begins the moment that somebody lets go of the robot.
  const auto commanded = commanded_at_us_.find(robot->id);
  if (commanded != commanded_at_us_.end() && parts_.clock.steady_us() - commanded->second < kUnusedFor.count()) {
    return {"robot_in_use", "somebody has just commanded the robot"};
  }
  // SAFETY: its own client is there when it begins, also for an unattended one.
  if (!entry.life.is_fresh(parts_.clock.steady_us())) {
    return {"nobody_present",
            text(station::Client{experiment.acts_for, experiment.client}) + " gives no sign of life for it"};
  }
  const std::vector<std::string>& fluids = entry.profile.sweep.fluids;
  const std::string fluid = fluids.empty() ? entry.profile.conditions.fluid : fluids.front();
  if (!fluid.empty() && !robot->fluid.empty() && fluid != robot->fluid) {
    return {"fluid", fmt::format("the robot is in '{}', the first run is in '{}'", robot->fluid, fluid)};
  }
  if (const auto room = recording_.disk_watch.may_begin("an experiment"); !room)
    return {"disk_space", room.error().detail};
  return {};
}

Experiments::WaitReason Experiments::reserved_for_another(const Experiment& experiment) const {
  const microseconds lasts{static_cast<std::int64_t>(experiment.duration_s * 1e6)};
  const station::Reservation* slot =
      parts_.station.reserved_for_another(experiment.request.robot_id, experiment.acts_for, lasts + kRestBefore);
  if (slot == nullptr) return {};
  const std::string from = station::utc_text(slot->from_us), until = station::utc_text(slot->until_us);
  if (slot->from_us <= parts_.clock.utc_us()) {
    return {"reserved", fmt::format("the robot is reserved for {} until {}", slot->holder, until)};
  }
  return {"reserved_soon", fmt::format("the robot is reserved for {} from {} until {}, and it lasts {:.0f} s",
                                       slot->holder, from, until, experiment.duration_s)};
}

// SAFETY: what nobody waits for any more begins for nobody who comes by.
void Experiments::hold_what_is_left_alone() {
  const std::int64_t now_us = parts_.clock.steady_us();
  for (auto& [id, entry] : entries_) {
    Experiment& experiment = entry.experiment;
    const auto running = running_.find(experiment.request.robot_id);
    const bool is_about_to_begin = running != running_.end() && running->second == id;
    const bool waits = experiment.state == ExperimentState::waiting && !entry.conduct && !is_about_to_begin;
    if (!waits || experiment.is_held || entry.life.absent_for_us(now_us) <= kHeldAfter.count()) continue;
    experiment.is_held = entry.is_changed = true;
    experiment.reason = "nobody_present";
  }
}

void Experiments::begin_what_may() {
  std::set<station::RobotId> robots;
  for (const auto& [id, entry] : entries_) robots.insert(entry.experiment.request.robot_id);
  for (const station::RobotId& robot_id : robots) {
    bool is_turn = true;
    for (Entry* entry : queue_of(robot_id)) {
      WaitReason waits = wait_reason_of(*entry);
      const bool lets_others_go = std::ranges::find(kLetsOthersGo, waits.reason) != kLetsOthersGo.end();
      if (!is_turn && !lets_others_go) waits = {"others", "others are before it"};
      is_turn = is_turn && lets_others_go;
      entry->waits_for = std::move(waits.reason);
      entry->waits_for_detail = std::move(waits.detail);
      if (!entry->waits_for.empty()) continue;
      const ExperimentId id = entry->experiment.id;
      running_[robot_id] = id;
      spawn(fmt::format("experiment {}", id), carry_out(id));
      break;
    }
  }
}

// --- one that runs ---

// SAFETY: the robot is at rest when the slot of somebody else begins, while its actor may still command it.
void Experiments::abort_if_reserved(const station::RobotId& robot_id) {
  Conduct* conduct = conduct_of(robot_id);
  if (conduct == nullptr || conduct->is_aborting()) return;
  const std::string& actor = entries_.at(running_.at(robot_id)).experiment.acts_for;
  const station::Reservation* slot = parts_.station.reserved_for_another(robot_id, actor, kRestBefore);
  if (slot == nullptr) return;
  conduct->abort({"reserved", fmt::format("the robot is reserved for {} from {} until {}", slot->holder,
                                          station::utc_text(slot->from_us), station::utc_text(slot->until_us))});
}

asio::awaitable<void> Experiments::carry_out(ExperimentId id) {
  Entry& entry = entries_.at(id);
  entry.waits_for.clear();
  const ConductParts conduct_parts{parts_, recording_.recorder, recording_.runs, recording_.fluid_models, writer_,
                                   maths_, controller_by_name_, fit_of_runs_};
  entry.experiment.started_at_us = parts_.clock.utc_us();
  entry.experiment.state = ExperimentState::running;
  entry.experiment.reason.clear();
  entry.conduct = std::make_unique<Conduct>(conduct_parts, entry.experiment, entry.profile, entry.life);
  if (entry.end) end_in_nobodys_name(entry, *entry.end);
  const std::string name = fmt::format("experiment {}", id);
  co_await runtime::contained(parts_.tasks.exceptions(), parts_.clock, runtime::Ended::experiment, name,
                              conduct(entry));
  if (!entry.has_ended) {  // by an exception; SAFETY: first the robot
    entry.end = Abort{"internal", "the station could not go on with it; its log says why"};
    RestRequest rest{entry.experiment.request.robot_id, entry.experiment.acts_for, fmt::format("experiment:{}", id)};
    co_await bring_to_rest(parts_.station, parts_.clock, std::move(rest));
    co_await runtime::contained(parts_.tasks.exceptions(), parts_.clock, runtime::Ended::experiment, name,
                                entry.conduct->end_after_failure());
  }
  co_await finish(entry);
}

asio::awaitable<void> Experiments::conduct(Entry& entry) {
  auto begun = [experiment = entry.experiment](storage::Database& database) {
    storage::store_experiment(database, experiment);
  };
  co_await writer_.keep("the beginning of an experiment", std::move(begun));
  publish(entry);
  entry.end = co_await entry.conduct->run();
  entry.has_ended = true;
}

asio::awaitable<void> Experiments::finish(Entry& entry) {
  Experiment& experiment = entry.experiment;
  experiment.state = entry.end ? ExperimentState::aborted : ExperimentState::done;
  const Conclusion* conclusion = entry.conduct->conclusion();
  experiment.reason = entry.end ? entry.end->reason : conclusion ? conclusion->reason : "";
  experiment.detail = entry.end ? entry.end->detail : conclusion ? conclusion->detail : "";
  experiment.ended_at_us = parts_.clock.utc_us();
  const std::string actor = experiment.reason == kRightEnded ? kStationActor : experiment.acts_for;
  const station::Author by{actor, fmt::format("experiment:{}", experiment.id), *experiment.ended_at_us};
  // Its control was taken for longer than a sign of life lasts; who commands the robot by now keeps it.
  const station::RobotId& of_robot = experiment.request.robot_id;
  const bool is_kept = parts_.station.holder(of_robot) == experiment.acts_for &&
                       parts_.station.is_kept_by(of_robot, {experiment.acts_for, experiment.client});
  if (experiment.request.is_unattended && experiment.reason != "operator_command" && is_kept) {
    station::ControlRequest release{.robot_id = of_robot, .actor = actor, .peer = by.peer, .reason = {}};
    release.action = station::ControlAction::release;
    static_cast<void>(parts_.station.control(release));
  }
  auto ended = [experiment, note = note_of(entry, entry.end ? "aborted" : "done", by)](storage::Database& database) {
    storage::store_experiment(database, experiment, note);
  };
  co_await keep_if_it_can_be("the end of an experiment", std::move(ended));
  publish(entry);
  const station::RobotId robot_id = experiment.request.robot_id;
  const bool is_aborted = entry.end.has_value();
  const ExperimentId id = experiment.id;
  if (is_aborted && entry.end->reason != "reserved") co_await hold_queue(robot_id);  // else it is somebody's turn
  running_.erase(robot_id);
  entries_.erase(id);
  changed_.notify();
  wake_.notify();
}

// SAFETY: after an abort nothing begins before somebody has looked.
asio::awaitable<void> Experiments::hold_queue(station::RobotId robot_id) {
  std::vector<Experiment> held = hold_all(robot_id, "previous_aborted");
  auto hold = [held](storage::Database& database) {
    for (const Experiment& experiment : held) storage::store_experiment(database, experiment);
  };
  co_await keep_if_it_can_be("the queue of a robot", std::move(hold));
}

// What no disk takes is noted, and keeps the robot's queue not.
asio::awaitable<void> Experiments::keep_if_it_can_be(std::string what, std::function<void(storage::Database&)> change) {
  auto keep = writer_.keep(what, std::move(change));
  co_await runtime::contained(parts_.tasks.exceptions(), parts_.clock, runtime::Ended::experiment, what,
                              std::move(keep));
}

storage::ExperimentState Experiments::state_of(const Entry& entry) const {
  if (!entry.conduct || storage::has_ended(entry.experiment.state)) return entry.experiment.state;
  if (entry.conduct->is_aborting()) return ExperimentState::aborting;
  return entry.conduct->is_paused() ? ExperimentState::paused : ExperimentState::running;
}

// What has become of those that run, or was held, as far as the database does not know it; stored aside, since a
// failing disk must not keep this from its next look.
void Experiments::note_states() {
  if (is_storing_) return;
  std::vector<Experiment> changed;
  for (auto& [id, entry] : entries_) {
    const ExperimentState state = state_of(entry);
    const bool is_other = entry.conduct && state != entry.experiment.state;
    if (!is_other && !entry.is_changed) continue;
    entry.is_changed = false;
    if (is_other) {
      entry.experiment.state = state;
      give_reason(entry.experiment, entry.conduct->pause_reason());
    }
    changed.push_back(entry.experiment);
    publish(entry);
  }
  if (changed.empty()) return;
  is_storing_ = true;
  changed_.notify();
  spawn("states of experiments", store_states(std::move(changed)));
}

asio::awaitable<void> Experiments::store_states(std::vector<Experiment> changed) {
  struct Stored {
    bool& is_storing;
    ~Stored() { is_storing = false; }
  };
  const Stored stored{is_storing_};
  auto store = [changed = std::move(changed)](storage::Database& database) {
    for (const Experiment& experiment : changed) storage::store_experiment(database, experiment);
  };
  co_await writer_.keep("the state of an experiment", std::move(store));
}

void Experiments::publish(const Entry& entry) {
  changed_.notify();
  on_change_(summary_of(entry));
}

ExperimentView Experiments::view_of(const Entry& entry) const {
  ExperimentView view = summary_of(entry);
  if (entry.conduct) view.experiment.runs = entry.conduct->runs();
  return view;
}

ExperimentView Experiments::summary_of(const Entry& entry) const {
  ExperimentView view{entry.experiment, entry.waits_for, entry.waits_for_detail, std::nullopt,
                      entry.conduct ? entry.conduct->activity() : ""};
  view.experiment.state = state_of(entry);
  if (!entry.conduct) return view;
  view.experiment.run_counts = storage::counts_of(entry.conduct->runs());
  const Abort* why = entry.conduct->pause_reason();
  if (why != nullptr || view.experiment.state == ExperimentState::running) give_reason(view.experiment, why);
  const RunDriver* driver = entry.conduct->driver();
  if (driver == nullptr || storage::has_ended(view.experiment.state)) return view;
  view.progress = ExperimentProgress{
      entry.conduct->number(),    entry.experiment.runs_planned, entry.conduct->first_step() + driver->step(),
      entry.profile.steps.size(), driver->elapsed_s(),           driver->duration_s(),
      driver->goes_on_in_s()};
  return view;
}

// --- the station's reports ---

Conduct* Experiments::conduct_of(const station::RobotId& robot_id) {
  const auto found = running_.find(robot_id);
  if (found == running_.end()) return nullptr;
  return entries_.at(found->second).conduct.get();
}

void Experiments::on_samples(const station::RobotState& robot, const station::SampleBatch& batch) {
  if (Conduct* conduct = conduct_of(robot.id)) conduct->on_samples(batch);
}

void Experiments::on_robot(const station::RobotState& robot) {
  abort_if_reserved(robot.id);  // before anything else that the end of control means to it
  if (Conduct* conduct = conduct_of(robot.id)) conduct->on_robot(robot);
}

void Experiments::on_event(const station::RobotState& robot, const station::RobotEvent& event) {
  if (Conduct* conduct = conduct_of(robot.id)) conduct->on_event(event);
}

// SAFETY: after a stop nothing begins before somebody has looked, whether an experiment ran or not.
void Experiments::hold_after_stop(const station::RobotId& robot_id) {
  for (const Experiment& held : hold_all(robot_id, "emergency_stop")) entries_.at(held.id).is_changed = true;
}

// Those that were not held, held now. One that is still being added is held when it comes.
std::vector<Experiment> Experiments::hold_all(const station::RobotId& robot_id, const char* reason) {
  holds_[robot_id] = {holds_[robot_id].count + 1, reason};
  std::vector<Experiment> held;
  for (Entry* entry : queue_of(robot_id)) {
    if (std::exchange(entry->experiment.is_held, true)) continue;
    entry->experiment.reason = reason;
    held.push_back(entry->experiment);
  }
  return held;
}

void Experiments::on_stop_again(const station::CommandRecord& in_force) { hold_after_stop(in_force.robot_id); }

void Experiments::on_command(const station::CommandRecord& record) {
  const bool is_new = record.acknowledged_after_us < 0 && record.ended_at_us == 0;
  if (record.kind == "emergency_stop" && is_new) hold_after_stop(record.robot_id);
  // SAFETY: somebody who resets an emergency may still be at the tube.
  if (is_new && (disturbance_of(record, "") || record.kind == "clear_emergency")) {
    const bool is_own = record.peer.starts_with("experiment:");
    if (!is_own) commanded_at_us_[record.robot_id] = parts_.clock.steady_us();
  }
  if (Conduct* conduct = conduct_of(record.robot_id)) conduct->on_command(record);
}

}  // namespace server::experiments
