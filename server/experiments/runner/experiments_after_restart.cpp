// What an earlier start of the station has left: experiments that waited, and robots that are to be brought to rest.
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
    std::vector<station::RobotId> to_rest;
    std::vector<Experiment> waiting;
  };
  std::optional<Left> left;
  while (!left) {
    auto read = [utc_us = parts_.clock.utc_us()](storage::Database& database) -> std::optional<Left> {
      try {
        auto robots = storage::interrupt_experiments(database, utc_us);
        return Left{std::move(robots), storage::waiting_experiments(database.handle())};
      } catch (const SQLite::Exception& error) {
        spdlog::error("the experiments cannot be read: {}; it is tried again", runtime::text_of(error));
        return std::nullopt;
      }
    };
    left = co_await recording_.recorder.on_disk(std::move(read));
    if (!left) co_await parts_.clock.sleep_for(kReadAgainAfter);
  }
  to_rest_ = {left->to_rest.begin(), left->to_rest.end()};
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

// SAFETY: the robot of an experiment that a restart interrupted goes on in auto, if its link held; nobody watches it.
// It stays on the list, also over further restarts, until it was seen at rest, or somebody else controls it.
void Experiments::put_interrupted_to_rest() {
  const std::set<station::RobotId> robots = to_rest_;  // a task may begin, and end, at once
  for (const station::RobotId& id : robots) {
    const station::RobotState* robot = parts_.station.find(id);
    const bool is_known = robot != nullptr && robot->link == station::LinkState::connected && robot->sample;
    if (is_known && resting_.insert(id).second) spawn("rest of robot '" + id + "'", settle_rest(id));
  }
}

asio::awaitable<void> Experiments::settle_rest(station::RobotId robot_id) {
  struct Resting {
    std::set<station::RobotId>& robots;
    station::RobotId id;
    ~Resting() { robots.erase(id); }
  };
  const Resting one{resting_, robot_id};
  const station::RobotState* robot = parts_.station.find(robot_id);
  if (!robot->latched() && !is_at_rest(*robot)) {
    RestRequest request{robot_id, kStationActor, "experiment:interrupted"};
    co_await bring_to_rest(parts_.station, parts_.clock, std::move(request));
  }
  to_rest_.erase(robot_id);
  auto seen = [robot_id](storage::Database& database) { storage::note_rest(database, robot_id); };
  co_await writer_.keep("the rest of a robot", std::move(seen));
}

}  // namespace server::experiments
