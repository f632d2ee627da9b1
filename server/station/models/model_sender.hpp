// Gives each robot the model of the fluid that it swims in, and takes back what was confirmed for another: starts each
// exchange, keeps what is owed, and publishes what has become of it.
//
//   somebody names the fluid of a robot (POST …/fluid, or a run that names one), or sends it a model of its own
//     → ModelExchange sends the model, or takes the confirmation back, on behalf of that actor
//   a robot reports its confirmation or its parameters
//     → judge() finds whether the confirmation stands
//
// What could not be done stands in RobotState::model and an event.
//
// An own model was sent to one robot alone, for the fluid that was named for it. When that fluid is named again the
// robot keeps it, unless the list's model of the fluid was set or changed meanwhile. It ends with the robot's boot, and
// when another fluid is named.
//
// SAFETY: a confirmation that is not this fluid's is owed to be taken back, however long that takes: after an exchange
// has failed it is tried again at rest, each kRetryInterval, until telemetry shows that it is gone or the robot has
// booted. So is one that this station has not seen being made (it was restarted meanwhile, or the robot comes from
// another), unless the robot's parameters are the model of the fluid that is named for it.
//
// Loop thread. A task for each robot that something is sent to, and one for all; what fails inside for one robot is
// logged and counted, makes its model `failed`, and stops neither task. Everything it is given outlives its
// tasks.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <set>
#include <string>
#include <unordered_map>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/tasks.hpp"
#include "server/station/models/fluid_naming.hpp"
#include "server/station/models/observed_confirmation.hpp"
#include "server/station/state/fluid_model.hpp"
#include "server/station/station.hpp"

namespace server::station {

class ModelSender final : public StationSink {
 public:
  static constexpr microseconds kRetryInterval{5'000'000};  // of what is owed

  // From now on models are sent; a task of the group watches what robots report of theirs.
  ModelSender(boost::asio::io_context& loop, runtime::TaskGroup& tasks, runtime::Clock& clock, Station& station,
              const FluidModelList& models);

  void on_robot(const RobotState& robot) override;
  void on_samples(const RobotState& robot, const SampleBatch& batch) override;
  void on_in_force(const RobotState& robot, const InForceRecord& record) override;
  void on_right_ended(const runtime::EndedRight& right) override;

 private:
  class StationRobot;
  struct Entry {
    FluidNaming naming;  // the newest
    ObservedConfirmation seen;
    bool is_at_work = false;       // a task sends the robot something
    bool owes = false;             // a confirmation is to be taken back
    std::int64_t next_try_us = 0;  // steady
    std::string reported_failure;  // of the newest naming, by an event
  };
  using Outcome = Result<void>;

  boost::asio::awaitable<void> run();
  boost::asio::awaitable<void> work(RobotId id);
  boost::asio::awaitable<void> alone(RobotId id, boost::asio::awaitable<void> task);
  boost::asio::awaitable<void> carry_out(RobotId id, FluidNaming naming, Outcome& outcome);
  boost::asio::awaitable<void> finish(RobotId id, FluidNaming naming, Outcome outcome);
  boost::asio::awaitable<void> look_at(RobotId id);

  void on_model_wanted(const RobotState& robot, const Author& by, std::optional<FluidModel> own);
  static bool has_arrived(const RobotModel& now, const Entry& entry);
  const FluidModel* own_model(const RobotState& robot, const Entry& entry) const;  // null: none that stands
  void begin(const RobotId& id, Entry& entry);
  void conclude(const RobotId& id, const FluidNaming& naming, const Outcome& outcome);
  void conclude_failure(const RobotId& id, const FluidNaming& naming, const Error& error);
  void follow(const RobotState& robot, Entry& entry);
  void follow_confirmation(const RobotState& robot, Entry& entry);
  void settle_debt(const RobotState& robot, Entry& entry);
  void look_again(const RobotId& id);

  boost::asio::io_context& loop_;
  runtime::TaskGroup& tasks_;
  runtime::Clock& clock_;
  Station& station_;
  const FluidModelList& models_;
  std::unordered_map<RobotId, Entry> entries_;
  std::set<RobotId> changed_;  // of which run() must know
  std::set<RobotId> open_;     // that owe, or whose confirmation is not judged yet
  runtime::Signal wake_;
};

}  // namespace server::station
