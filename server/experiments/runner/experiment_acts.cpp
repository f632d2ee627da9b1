// What people do with experiments: begin, look, pause, resume, abort, take over, move.
#include <fmt/format.h>

#include <algorithm>

#include "server/experiments/limits_check.hpp"
#include "server/experiments/profile_document.hpp"
#include "server/experiments/runner/experiments.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/storage/experiments/experiment_store.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using storage::Experiment;
using storage::ExperimentId;
using storage::ExperimentState;

namespace {

std::unexpected<Error> no_such_experiment(ExperimentId id) {
  return fail(ErrorCode::not_found, fmt::format("there is no experiment {}", id), "no_such_experiment");
}

std::unexpected<Error> wrong_state(const ExperimentView& view, const char* what) {
  return fail(
      ErrorCode::conflict,
      fmt::format("experiment {} is {} and cannot be {}", view.experiment.id, text(view.experiment.state), what),
      "wrong_state");
}

}  // namespace

Result<Experiments::Prepared> Experiments::prepare(const std::string& document, const config::Envelope& envelope,
                                                   const std::string& fluid) {
  try {
    Prepared prepared;
    prepared.profile = parse_profile(document, "profile");
    if (auto allowed = check_limits(prepared.profile, envelope, fluid); !allowed)
      return std::unexpected{allowed.error()};
    prepared.demands = demands_of(prepared.profile);
    if (prepared.profile.until) {
      prepared.runs = static_cast<std::uint32_t>(prepared.profile.most_runs);
      const bool goes_back = prepared.profile.conditions.start == StartPosition::back;
      const double between_s = kBetweenRuns_s + (goes_back ? kWayBack_s : 0);
      prepared.duration_s = prepared.runs * (longest_duration_s(prepared.profile) + between_s);
      return prepared;
    }
    for (const Variant& variant : variants_of(prepared.profile)) {
      ++prepared.runs;
      if (variant.repeat == 1)
        prepared.duration_s +=
            static_cast<double>(prepared.profile.sweep.repeats) * time_line_of(prepared.profile, variant).duration_s();
    }
    return prepared;
  } catch (const std::invalid_argument& error) {
    return fail(ErrorCode::invalid, error.what(), "profile");
  }
}

Result<void> Experiments::check_request(const storage::ExperimentRequest& request) const {
  const station::RobotState* robot = parts_.station.find(request.robot_id);
  if (robot == nullptr) {
    return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", request.robot_id), "unknown_robot");
  }
  // It would wait for ever. Of a robot that is away it is not known.
  if (robot->link == station::LinkState::connected && robot->sample_period_us != kTickUs)
    return fail(ErrorCode::invalid, "experiments are for robots that sample each 10 ms", "sample_period");
  // SAFETY: an administrator decides whether robots may move while nobody is there.
  if (request.is_unattended && !allow_unattended_) {
    return fail(ErrorCode::forbidden,
                "the station's configuration does not allow unattended experiments (experiments.allow_unattended)",
                "unattended_not_allowed");
  }
  if (!is_loaded_) return fail(ErrorCode::unavailable, "the station is just starting; try again", "starting");
  if (entries_.size() + being_added_.size() < kMostQueued) return {};
  return fail(ErrorCode::unavailable, fmt::format("{} experiments wait already", kMostQueued), "too_many_experiments");
}

asio::awaitable<Result<ExperimentView>> Experiments::begin(storage::ExperimentRequest request, station::Author by,
                                                           std::optional<std::int64_t> seen_at_us) {
  if (auto allowed = check_request(request); !allowed) co_return std::unexpected{allowed.error()};
  const runtime::RequestsOnTheirWay::Request one_more{being_added_, by.actor};
  const station::RobotId robot_id = request.robot_id;
  const std::uint64_t holds_before = holds_[robot_id].count;
  auto job = [document = request.profile, envelope = parts_.station.envelope(),
              fluid = parts_.station.find(request.robot_id)->fluid] { return prepare(document, envelope, fluid); };
  auto prepared = co_await maths_.run(std::move(job));
  if (!prepared) co_return std::unexpected{prepared.error()};
  if (request.is_unattended && !prepared->profile.is_unattended) {
    co_return fail(ErrorCode::invalid, "the profile does not say unattended = true", "unattended_not_allowed");
  }
  const bool is_there = parts_.station.find(request.robot_id)->link == station::LinkState::connected;
  const RobotLimits limits = limits_of(is_there ? parts_.station.settings(request.robot_id) : nullptr);
  if (auto taken = check_demands(prepared->demands, limits); !taken) co_return std::unexpected{taken.error()};
  Entry entry;
  entry.profile = std::move(prepared->profile);
  Experiment& experiment = entry.experiment;
  experiment.request = std::move(request);
  experiment.request.name = entry.profile.name;
  experiment.owner = experiment.acts_for = by.actor;
  experiment.client = by.client;
  experiment.runs_planned = prepared->runs;
  experiment.duration_s = prepared->duration_s;
  by.at_us = experiment.created_at_us = parts_.clock.utc_us();
  station::AuditNote note = note_of(entry, "queued", by);
  auto add = [&experiment, &note](storage::Database& database) -> Result<void> {
    try {
      storage::add_experiment(database, experiment, note);
      return {};
    } catch (const SQLite::Exception& error) {
      return fail(ErrorCode::unavailable, fmt::format("it could not be stored: {}; try again", runtime::text_of(error)),
                  "not_stored");
    }
  };
  const Result<void> stored = co_await recording_.recorder.on_disk(std::move(add));
  if (!stored) co_return std::unexpected{stored.error()};
  const ExperimentId id = experiment.id;
  Entry& kept = entries_[id];
  kept = std::move(entry);
  kept.life.since_us = parts_.clock.steady_us();
  if (seen_at_us) {
    keep_alive(id, {by.actor, by.client}, microseconds{parts_.clock.steady_us() - *seen_at_us});
  }
  if (holds_[robot_id].count !=
      holds_before) {  // SAFETY: a stop, or an abort, while it was being stored holds it as well
    kept.experiment.is_held = kept.is_changed = true;
    kept.experiment.reason = holds_[robot_id].reason;
  }
  // SAFETY: a right that ended while it was being stored ends it as it ends one that waits.
  if (!one_more.ended().empty()) {
    note = note_of(kept, "cancelled", {kStationActor, "", parts_.clock.utc_us()});
    Experiment ended = take_out(id, kRightEnded, one_more.ended());
    co_await store_end(std::move(ended), std::move(note));
    co_return fail(ErrorCode::forbidden, one_more.ended(), "not_permitted");
  }
  const WaitReason waits = wait_reason_of(kept);
  kept.waits_for = waits.reason;
  kept.waits_for_detail = waits.detail;
  publish(kept);
  wake_.notify();
  co_return view_of(kept);
}

asio::awaitable<Result<ExperimentView>> Experiments::find(ExperimentId id) {
  if (const auto found = entries_.find(id); found != entries_.end()) co_return view_of(found->second);
  auto query = [id](SQLite::Database& database) { return storage::find_experiment(database, id); };
  auto found = co_await recording_.reader.ask(std::move(query));
  if (!found) co_return no_such_experiment(id);
  co_return ExperimentView{std::move(*found), "", "", std::nullopt};
}

asio::awaitable<std::vector<ExperimentView>> Experiments::list(storage::ExperimentFilter filter) {
  auto query = [filter](SQLite::Database& database) { return storage::list_experiments(database, filter); };
  std::vector<Experiment> found = co_await recording_.reader.ask(std::move(query));
  std::vector<ExperimentView> views;
  for (Experiment& experiment : found) {
    const auto known = entries_.find(experiment.id);
    views.push_back(known != entries_.end() ? summary_of(known->second)
                                            : ExperimentView{std::move(experiment), "", "", std::nullopt});
  }
  co_return views;
}

asio::awaitable<std::optional<std::string>> Experiments::prediction(ExperimentId id, std::uint32_t number) {
  auto query = [id, number](SQLite::Database& database) {
    return storage::experiment_prediction(database, id, number);
  };
  co_return co_await recording_.reader.ask(std::move(query));
}

asio::awaitable<Result<ExperimentView>> Experiments::wait_for_change(ExperimentId id, microseconds patience) {
  const std::int64_t ends_us = parts_.clock.steady_us() + patience.count();
  auto first = co_await find(id);
  if (!first || storage::has_ended(first->experiment.state)) co_return first;
  for (;;) {
    if (parts_.clock.steady_us() >= ends_us) co_return co_await find(id);
    co_await changed_.wait_until(parts_.clock, ends_us);
    const auto known = entries_.find(id);
    if (known == entries_.end() || state_of(known->second) != first->experiment.state) co_return co_await find(id);
  }
}

// --- in whose hands one is ---

bool Experiments::keep_alive(ExperimentId id, const station::Client& client, microseconds age) {
  Entry* entry = entry_of(id);
  if (entry == nullptr) return false;
  const Experiment& experiment = entry->experiment;
  if (client != station::Client{experiment.acts_for, experiment.client}) return false;
  if (!station::is_fresh(age)) return true;
  const std::int64_t seen_us = parts_.clock.steady_us() - age.count();
  entry->life.seen_us = std::max(entry->life.seen_us.value_or(seen_us), seen_us);
  parts_.station.keep_control(client, experiment.request.robot_id, age);
  return true;
}

const Life* Experiments::life_of(ExperimentId id) const {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second.life;
}

// Without a sign of life its client has shown itself by what it asked for: it is there, and its signs follow.
void Experiments::put_into_hands_of(Entry& entry, const station::Client& client,
                                    std::optional<std::int64_t> seen_at_us) {
  entry.experiment.acts_for = client.actor;
  entry.experiment.client = client.id;
  entry.life.since_us = parts_.clock.steady_us();
  entry.life.seen_us = seen_at_us.value_or(entry.life.since_us - station::kOldestSight.count() - 1);
  if (entry.conduct) entry.conduct->set_client(client);
}

// With what waits on the robot, as far as it is the experiment's.
Result<void> Experiments::take_control_for(const Entry& entry, const station::Client& client, const std::string& peer) {
  const station::RobotId& robot_id = entry.experiment.request.robot_id;
  const std::string holder = parts_.station.holder(robot_id);
  const bool is_free = holder.empty(), has_it = !is_free && parts_.station.is_kept_by(robot_id, client);
  if (!entry.conduct || has_it || (!is_free && holder != client.actor)) return {};
  station::ControlRequest request{.robot_id = robot_id, .actor = client.actor, .peer = peer, .reason = {}};
  request.client = client.id;
  if (entry.experiment.acts_for == client.actor) request.orders_of = entry.experiment.client;
  if (entry.experiment.request.is_unattended) request.lease = station::kLongestControl;
  const auto taken = parts_.station.control(request);
  if (!taken) return std::unexpected{taken.error()};
  return {};
}

// --- what changes one ---

// Null when it has ended, or there never was one.
Experiments::Entry* Experiments::entry_of(ExperimentId id) {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second;
}

// Refuses an act on an experiment without an entry.
asio::awaitable<Result<ExperimentView>> Experiments::refuse(ExperimentId id, const char* what) {
  const auto view = co_await find(id);
  if (!view) co_return std::unexpected{view.error()};
  co_return wrong_state(*view, what);
}

std::optional<ExperimentView> Experiments::summary(ExperimentId id) const {
  const auto found = entries_.find(id);
  return found == entries_.end() ? std::nullopt : std::optional{summary_of(found->second)};
}

station::AuditNote Experiments::note_of(const Entry& entry, const char* what, const station::Author& by) const {
  station::AuditNote note;
  note.by = by;
  note.robot_id = entry.experiment.request.robot_id;
  note.action = fmt::format("experiment.{}", what);
  note.subject = fmt::format("{}", entry.experiment.id);
  nlohmann::json detail{{"name", entry.experiment.request.name}, {"reason", entry.experiment.reason}};
  if (!by.client.empty()) detail["by"] = text(station::Client{by.actor, by.client});
  note.detail = station::audit_detail(detail);
  return note;
}

// What was done is on disk, with its entry in the audit, when it is answered.
asio::awaitable<Result<ExperimentView>> Experiments::stored(ExperimentId id, station::AuditNote note) {
  Entry* entry = entry_of(id);
  if (entry == nullptr) co_return co_await find(id);
  auto store = [experiment = entry->experiment, note = std::move(note)](storage::Database& database) {
    storage::store_experiment(database, experiment, note);
  };
  publish(*entry);
  wake_.notify();
  co_await writer_.keep("the state of an experiment", std::move(store));
  co_return co_await find(id);
}

asio::awaitable<Result<ExperimentView>> Experiments::pause(ExperimentId id, station::Author by) {
  by.at_us = parts_.clock.utc_us();
  Entry* entry = entry_of(id);
  if (entry == nullptr) co_return co_await refuse(id, "paused");
  // SAFETY: also one that is paused by itself, which would go on by itself.
  const ExperimentState state = state_of(*entry);
  const bool is_at_work = state == ExperimentState::running || state == ExperimentState::paused;
  if (!is_at_work || !entry->conduct) co_return wrong_state(view_of(*entry), "paused");
  entry->conduct->pause({"requested", fmt::format("{} has paused it", by.actor)});
  co_return co_await stored(id, note_of(*entry, "paused", by));
}

asio::awaitable<Result<ExperimentView>> Experiments::resume(ExperimentId id, station::Author by,
                                                            std::optional<std::int64_t> seen_at_us) {
  by.at_us = parts_.clock.utc_us();
  Entry* entry = entry_of(id);
  if (entry == nullptr) co_return co_await refuse(id, "resumed");
  Experiment& experiment = entry->experiment;
  if (experiment.acts_for != by.actor) {
    co_return fail(ErrorCode::conflict,
                   fmt::format("it acts in the name of {}; take it over to go on with it", experiment.acts_for),
                   "acts_for_another");
  }
  const ExperimentState state = state_of(*entry);
  const bool is_held = state == ExperimentState::waiting && experiment.is_held;
  if (state != ExperimentState::paused && !is_held) co_return wrong_state(view_of(*entry), "resumed");
  // Into the hands of who resumes it, unless its client is there: a person may resume what their other tool performs.
  // Control comes into the same hands, from whatever page or program of the actor has it.
  const bool is_alone = !entry->life.seen_us || entry->life.absent_for_us(parts_.clock.steady_us()) > kAwayFor.count();
  const station::Client client{by.actor, is_alone ? by.client : experiment.client};
  if (auto taken = take_control_for(*entry, client, by.peer); !taken) co_return std::unexpected{taken.error()};
  if (is_alone) put_into_hands_of(*entry, client, seen_at_us);
  experiment.is_held = false;
  experiment.reason.clear();
  entry->life.since_us = parts_.clock.steady_us();
  if (entry->conduct) entry->conduct->resume();
  co_return co_await stored(id, note_of(*entry, "resumed", by));
}

// SAFETY: first the robot, then the database.
asio::awaitable<Result<ExperimentView>> Experiments::abort(ExperimentId id, std::string reason, station::Author by) {
  by.at_us = parts_.clock.utc_us();
  Entry* found = entry_of(id);
  if (found == nullptr) co_return co_await refuse(id, "aborted");
  Entry& entry = *found;
  const std::string detail =
      reason.empty() ? fmt::format("{} has ended it", by.actor) : fmt::format("{} has ended it: {}", by.actor, reason);
  if (entry.conduct) {
    entry.conduct->abort({"requested", detail});
    co_return co_await stored(id, note_of(entry, "abort_requested", by));
  }
  if (running_.contains(entry.experiment.request.robot_id) && running_[entry.experiment.request.robot_id] == id) {
    co_return fail(ErrorCode::conflict, "it is just about to begin; try again", "wrong_state");
  }
  const station::AuditNote note = note_of(entry, "cancelled", by);
  Experiment ended = take_out(id, "requested", detail);
  co_await store_end(std::move(ended), note);
  co_return co_await find(id);
}

asio::awaitable<Result<ExperimentView>> Experiments::take_over(ExperimentId id, station::Author by,
                                                               std::optional<std::int64_t> seen_at_us) {
  by.at_us = parts_.clock.utc_us();
  Entry* found = entry_of(id);
  if (found == nullptr) co_return co_await refuse(id, "taken over");
  Entry& entry = *found;
  const ExperimentState state = state_of(entry);
  if (state == ExperimentState::aborting || storage::has_ended(state)) {
    co_return wrong_state(view_of(entry), "taken over");
  }
  const station::RobotId& robot_id = entry.experiment.request.robot_id;
  const std::string holder = parts_.station.holder(robot_id);
  if (const auto* slot = parts_.station.reserved_for_another(robot_id, by.actor, microseconds{0})) {
    co_return fail(
        ErrorCode::conflict,
        fmt::format("its robot is reserved for {} until {}", slot->holder, station::utc_text(slot->until_us)),
        "reserved");
  }
  // SAFETY: control never changes hands by the way of an experiment.
  if (!holder.empty() && holder != by.actor) {
    co_return fail(ErrorCode::conflict, fmt::format("control of its robot is with {}; take that first", holder),
                   "not_in_control");
  }
  const station::Client client{by.actor, by.client};
  if (auto taken = take_control_for(entry, client, by.peer); !taken) co_return std::unexpected{taken.error()};
  put_into_hands_of(entry, client, seen_at_us);
  co_return co_await stored(id, note_of(entry, "taken_over", by));
}

asio::awaitable<Result<ExperimentView>> Experiments::move(ExperimentId id, ExperimentId before, std::int64_t priority,
                                                          station::Author by) {
  by.at_us = parts_.clock.utc_us();
  Entry* found = entry_of(id);
  if (found == nullptr) co_return co_await refuse(id, "moved");
  Entry& entry = *found;
  if (entry.conduct) co_return wrong_state(view_of(entry), "moved");
  std::vector<Entry*> queue = queue_of(entry.experiment.request.robot_id);
  std::erase(queue, &entry);
  const auto at = std::ranges::find_if(queue, [before](const Entry* one) { return one->experiment.id == before; });
  if (before != 0 && at == queue.end()) {
    co_return fail(ErrorCode::invalid, fmt::format("experiment {} does not wait for this robot", before),
                   "no_such_place");
  }
  std::vector<std::int64_t> places{entry.experiment.place};
  for (const Entry* one : queue) places.push_back(one->experiment.place);
  std::ranges::sort(places);
  entry.experiment.request.priority = before == 0 ? priority : (*at)->experiment.request.priority;
  queue.insert(at, &entry);
  std::vector<Experiment> moved;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    queue[i]->experiment.place = places[i];
    moved.push_back(queue[i]->experiment);
  }
  auto store = [moved](storage::Database& database) {
    for (const Experiment& experiment : moved) storage::store_experiment(database, experiment);
  };
  station::AuditNote note = note_of(entry, "moved", by);
  co_await writer_.keep("the queue of a robot", std::move(store));
  co_return co_await stored(id, std::move(note));
}

}  // namespace server::experiments
