// Experiments that end from outside: by an earlier start of the station, or with a right.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "server/experiments/profile_document.hpp"
#include "server/experiments/runner/experiments.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/storage/experiments/experiment_store.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using storage::Experiment;

namespace {

constexpr microseconds kReadAgainAfter = 1s;

// The document was checked before it was stored.
std::optional<Profile> profile_of(const Experiment& experiment) {
  try {
    return parse_profile(experiment.request.profile, experiment.request.name);
  } catch (const std::invalid_argument& error) {
    spdlog::error("experiment {} cannot be read any more: {}", experiment.id, error.what());
    return std::nullopt;
  }
}

}  // namespace

// What an earlier start of the station has left; tried again while the disk cannot be written.
asio::awaitable<void> Experiments::load() {
  struct Left {
    std::vector<storage::OwedRest> owed;
    std::vector<Experiment> waiting;
  };
  std::optional<Left> left;
  while (!left) {
    auto read = [utc_us = parts_.clock.utc_us()](storage::Database& database) -> std::optional<Left> {
      try {
        auto owed = storage::interrupt_experiments(database, utc_us);
        return Left{std::move(owed), storage::waiting_experiments(database.handle())};
      } catch (const SQLite::Exception& error) {
        spdlog::error("the experiments cannot be read: {}; it is tried again", runtime::text_of(error));
        return std::nullopt;
      }
    };
    left = co_await recording_.recorder.on_disk(std::move(read));
    if (!left) co_await parts_.clock.sleep_for(kReadAgainAfter);
  }
  rests_.load(left->owed);
  spawn("queues of the last start", admit(std::move(left->waiting)));
}

// Profiles are parsed on the worker, one after another, beside run(), which brings robots to rest meanwhile. All of
// these experiments are held.
asio::awaitable<void> Experiments::admit(std::vector<Experiment> waiting) {
  for (Experiment& experiment : waiting) {
    auto parse = [experiment] { return profile_of(experiment); };
    auto profile = co_await maths_.run(std::move(parse));
    Entry& entry = entries_[experiment.id];
    entry.experiment = std::move(experiment);
    entry.is_unreadable = !profile;
    if (profile) entry.profile = std::move(*profile);
  }
  is_loaded_ = true;
}

// --- rights ---

// SAFETY: the robots that these experiments move are brought to rest by RestsOwed as well, which needs none of this.
void Experiments::on_right_ended(const runtime::EndedRight& right) {
  being_added_.end(right);
  std::vector<storage::ExperimentId> waiting;
  for (auto& [id, entry] : entries_) {
    if (!right.is_of(entry.experiment.acts_for)) continue;
    const auto running = running_.find(entry.experiment.request.robot_id);
    if (running == running_.end() || running->second != id) {
      waiting.push_back(id);
    } else if (entry.conduct) {
      end_in_nobodys_name(entry, {kRightEnded, right.why});
    } else {
      entry.end = Abort{kRightEnded, right.why};  // it is about to begin
    }
  }
  const station::Author by{kStationActor, "", parts_.clock.utc_us()};
  for (const storage::ExperimentId id : waiting) {
    entries_.at(id).experiment.reason = kRightEnded;
    const station::AuditNote note = note_of(entries_.at(id), "cancelled", by);
    spawn("an experiment whose right has ended", store_end(take_out(id, kRightEnded, right.why), note));
  }
}

std::set<std::string> Experiments::acting() const {
  std::set<std::string> actors;
  for (const auto& [id, entry] : entries_) {
    if (!entry.conduct || !entry.conduct->is_aborting()) actors.insert(entry.experiment.acts_for);
  }
  return actors;
}

void Experiments::end_in_nobodys_name(Entry& entry, Abort why) {
  entry.conduct->set_client({kStationActor, ""});
  entry.conduct->abort(std::move(why));
}

// One that waits has ended with this call; store_end() has it on disk.
Experiment Experiments::take_out(storage::ExperimentId id, std::string reason, std::string detail) {
  Experiment ended = std::move(entries_.at(id).experiment);
  entries_.erase(id);
  ended.state = storage::ExperimentState::cancelled;
  ended.reason = std::move(reason);
  ended.detail = std::move(detail);
  ended.ended_at_us = parts_.clock.utc_us();
  return ended;
}

asio::awaitable<void> Experiments::store_end(Experiment ended, station::AuditNote note) {
  auto store = [ended, note = std::move(note)](storage::Database& database) {
    storage::store_experiment(database, ended, note);
  };
  co_await writer_.keep("the end of an experiment", std::move(store));
  on_change_({std::move(ended), "", "", std::nullopt});
  changed_.notify();
  wake_.notify();
}

}  // namespace server::experiments
