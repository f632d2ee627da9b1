// Sends robots the model of the fluid that they swim in, and takes back what was confirmed for another.
//
//   somebody names the fluid of a robot (POST …/fluid, or a run that names one)
//     → the eight parameters of the fluid's model that the robot does not hold yet, one by one, each read back
//     → model_confirmed = 1, once all eight are the model's, bit for bit
//     → confirmed, when the robot's telemetry shows it
//   a fluid without a model, or none: → model_confirmed = 0, unless the robot's model is only assumed
//
// Each command goes through Station::submit on behalf of the actor that named the fluid. A robot takes parameters at
// rest only, so a moving robot is waited for, for kPatience. What could not be done stands in RobotState::model and an
// event.
//
// SAFETY: a confirmation that is not this fluid's is owed to be taken back, however long that takes: after kPatience it
// is tried again at rest, each kRetryInterval, until telemetry shows that it is gone or the robot has booted. So is one
// that this station has not seen being made (it was restarted meanwhile, or the robot comes from another), unless the
// robot's parameters are the model of the fluid that is named for it.
//
// Loop thread. A task for each robot that something is sent to, and one for all; what fails inside for one robot is
// logged and counted, makes its model `failed`, and stops neither task. Everything it is given outlives its
// tasks.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/tasks.hpp"
#include "server/station/state/fluid_model.hpp"
#include "server/station/station.hpp"

namespace server {

class ModelSender final : public StationSink {
 public:
  static constexpr microseconds kPatience{30'000'000};      // with a robot that moves
  static constexpr microseconds kRetryInterval{5'000'000};  // of what is owed

  // From now on models are sent; a task of the group watches what robots report of theirs.
  ModelSender(boost::asio::io_context& loop, TaskGroup& tasks, Clock& clock, Station& station,
              const FluidModelList& models);

  void on_robot(const RobotState& robot) override;
  void on_samples(const RobotState& robot, const SampleBatch& batch) override;
  void on_in_force(const RobotState& robot, const InForceRecord& record) override;

 private:
  // What somebody has said of a robot's fluid.
  struct Naming {
    std::uint64_t number = 0;  // counts those of this robot
    Author by;
    BootId boot_id = 0;
    std::string fluid;                // empty: not known
    std::optional<FluidModel> model;  // none: a confirmation is taken back
  };
  struct Place {
    Naming naming;                 // the newest
    std::string reported_failure;  // of the newest, by an event
    BootId boot_id = 0;            // that the next are about
    std::optional<bool> flag;      // telemetry says that the model is confirmed; none yet
    bool was_seen_to_rise = false;
    bool at_work = false;               // a task sends the robot something
    bool owes = false;                  // a confirmation is to be taken back
    std::int64_t next_try_us = 0;       // steady
    std::int64_t heard_first_us = 0;    // steady: when the flag was first known
    std::uint64_t page_before_seq = 0;  // the first sample made after the newest page of parameters
    std::int64_t page_came_us = 0;      // steady
  };
  using Outcome = Result<void>;

  boost::asio::awaitable<void> run();

  void on_fluid_named(const RobotState& robot, const Author& by);
  RobotModel only_assumed(const std::string& fluid) const;
  void begin(const RobotId& id, Place& place);
  boost::asio::awaitable<void> work(RobotId id);
  boost::asio::awaitable<void> alone(RobotId id, boost::asio::awaitable<void> task);
  boost::asio::awaitable<void> carry_out(RobotId id, Naming naming, Outcome& outcome);
  boost::asio::awaitable<void> finish(RobotId id, Naming naming, Outcome outcome);
  boost::asio::awaitable<void> look_at(RobotId id);
  boost::asio::awaitable<Outcome> send_model(RobotId id, Naming naming);
  boost::asio::awaitable<Outcome> take_back(RobotId id, Naming naming);
  boost::asio::awaitable<Outcome> set(RobotId id, Naming naming, std::string name, float value,
                                      std::int64_t deadline_us);
  boost::asio::awaitable<Outcome> read_back(RobotId id, std::string name, float value);
  boost::asio::awaitable<Outcome> wait_for_flag(RobotId id, bool flag);
  boost::asio::awaitable<Outcome> wait_for_rest(RobotId id, Naming naming, std::int64_t deadline_us);
  Outcome still_wanted(const RobotId& id, const Naming& naming) const;
  bool holds(const RobotId& id, const FluidModel& model) const;
  bool holds_another(const RobotId& id, const FluidModel& model) const;
  void conclude(const RobotId& id, const Naming& naming, const Outcome& outcome);
  void conclude_failure(const RobotId& id, const Naming& naming, const Error& error);
  void follow(const RobotState& robot, Place& place);
  bool is_flag_older_than_page(const RobotState& robot, const Place& place) const;
  void judge_unseen(const RobotState& robot, Place& place);
  void settle_debt(const RobotState& robot, Place& place);

  boost::asio::io_context& loop_;
  TaskGroup& tasks_;
  Clock& clock_;
  Station& station_;
  const FluidModelList& models_;
  std::unordered_map<RobotId, Place> places_;
  std::set<RobotId> changed_;  // of which run() must know
  std::set<RobotId> open_;     // that owe, or whose confirmation is not judged yet
  Signal wake_;
};

}  // namespace server
