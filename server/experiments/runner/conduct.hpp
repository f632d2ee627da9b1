// Conducts one experiment: prepares each run of its grid, records it, drives it, and says how it ended.
//
//   for each run: fluid, flow → controller → model on the robot → beginning of the run → time line → end of the run
//
// The runs are those of the profile's grid, or, with `until`, chosen one after another (until_known.hpp).
//
// Each run and its prediction is on disk before the robot moves. What cannot be prepared is a reason to pause (a person
// must change the fluid, or set the pump) or to abort. Loop thread; all that it is given outlives it, and it outlives
// the loop's run() or its own run().
#pragma once

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/experiments/adaptive/until_known.hpp"
#include "server/experiments/limits_check.hpp"
#include "server/experiments/runner/prediction.hpp"
#include "server/experiments/runner/run_driver.hpp"
#include "server/experiments/runner/stubborn_writer.hpp"
#include "server/storage/experiments/experiment.hpp"
#include "server/storage/runs/fluid_models.hpp"
#include "server/storage/runs/runs.hpp"

namespace server::experiments {

inline constexpr microseconds kFluidWithin{3'600'000'000};  // for a person to change it, or to set the pump
inline constexpr const char* kOtherController = "other_controller";
inline constexpr const char* kRightEnded = "right_ended";  // of who it acts for

Profile way_back();  // one setpoint, to 0

// The limits that a robot has reported; null: it has reported none.
RobotLimits limits_of(const station::RobotSettings* settings);

// The controller of a name that a profile mentions, for this robot. Errors say what is wrong with the name.
using ControllerByName =
    std::function<boost::asio::awaitable<Result<protocol::Controller>>(std::string name, station::RobotId robot_id)>;

struct ConductParts {
  DriverParts driver;
  const storage::Recorder& recorder;
  storage::Runs& runs;
  storage::FluidModels& fluid_models;
  StubbornWriter& writer;
  runtime::WorkerThread& maths;
  const ControllerByName& controller_by_name;
  const FitOfRuns& fit_of_runs;
};

class Conduct {
 public:
  // `life` is of the experiment, and outlives it.
  Conduct(const ConductParts& parts, storage::Experiment experiment, Profile profile, const Life& life);

  // None: all runs are done. The robot is at rest, in emergency, or of somebody else.
  boost::asio::awaitable<std::optional<Abort>> run();
  // After run() has thrown: the run that it was recording ends.
  boost::asio::awaitable<void> end_after_failure();

  void pause(Abort why);
  void resume();
  void abort(Abort why);
  void set_client(const station::Client& client);

  void on_samples(const station::SampleBatch& batch);
  void on_robot(const station::RobotState& robot);
  void on_command(const station::CommandRecord& record);
  void on_event(const station::RobotEvent& event);

  bool is_aborting() const { return abort_ || (driver_ && driver_->is_ending()); }
  // SAFETY: a robot that goes back within a pause is not called paused.
  bool is_paused() const { return pause_reason() != nullptr && !(driver_ && driver_->goes_back()); }
  const Abort* pause_reason() const;     // null: it is not paused, and does not go back
  const Conclusion* conclusion() const;  // of one with until that was not aborted: how it ended; else null
  const std::string& activity() const { return activity_; }  // while no run is under way, in words; or empty
  const RunDriver* driver() const { return driver_.get(); }
  std::uint32_t number() const { return number_; }        // of the run, from 1
  std::size_t first_step() const { return first_step_; }  // of the run, in the profile, from 1
  const std::vector<storage::ExperimentRun>& runs() const { return begun_; }

 private:
  struct ModelInUse {
    control::FractionalModel model;
    std::string model_of;  // "(28)", or the fluid
    std::optional<control::ExpectedUncertainty> uncertainty;
  };

  boost::asio::awaitable<std::optional<Variant>> next_run();  // none: there is no more
  boost::asio::awaitable<void> one_run(Variant variant);
  boost::asio::awaitable<void> check_limits_of_robot();
  boost::asio::awaitable<void> prepare(Variant variant);
  boost::asio::awaitable<void> await_fluid(std::string fluid);
  boost::asio::awaitable<void> await_flow();
  boost::asio::awaitable<void> await_actor();
  boost::asio::awaitable<void> await_resumption(microseconds limit = kLongestPause);
  boost::asio::awaitable<void> await_same_controller();
  boost::asio::awaitable<void> await_model();
  boost::asio::awaitable<void> send_controller(std::string name);
  boost::asio::awaitable<void> go_to_start();
  boost::asio::awaitable<void> await_samples_from(std::uint64_t robot_us);
  boost::asio::awaitable<Result<storage::Run>> create_run(const Variant& variant);
  boost::asio::awaitable<void> begin_recording(const Variant& variant, const TimeLine& line);
  boost::asio::awaitable<std::string> predict(const TimeLine& line);
  boost::asio::awaitable<DriveEnd> drive(const Profile& profile, TimeLine line);
  boost::asio::awaitable<Result<void>> check_travel(Profile profile, TimeLine rest, double position_m);
  boost::asio::awaitable<void> await_link();
  boost::asio::awaitable<std::int64_t> await_disk(std::int64_t ends_us, std::string problem);
  boost::asio::awaitable<void> end_recording();
  // The robot time at which it acts; aborts if it is refused. One that comes too late to the resting robot is sent
  // again.
  boost::asio::awaitable<std::uint64_t> submit(const char* what, protocol::Command command, std::string arguments);
  storage::RunConditions conditions_of(const Variant& variant) const;
  ModelInUse model_in_use() const;
  void take_control();
  void check_robot();
  void check_same_fluid();
  bool is_in_hands() const;
  void watch_latch(const station::RobotState& robot);
  bool is_actor_there() const;
  const station::RobotState& robot() const;
  std::string peer() const;
  storage::ExperimentRun& current() { return begun_.back(); }

  const ConductParts parts_;
  storage::Experiment experiment_;
  Profile profile_;
  const Life& life_;
  std::optional<UntilKnown> until_;  // of a profile with it
  Profile of_run_;                   // the present run's part of the profile, from this step on
  std::size_t first_step_ = 1;
  std::string fluid_;  // of the runs so far
  std::string activity_;
  std::unique_ptr<RunDriver> driver_;  // null: none is at work
  std::optional<Abort> abort_;
  std::optional<Abort> waiting_for_;  // paused while no driver is at work
  station::BootId boot_id_ = 0;
  std::uint32_t controller_checksum_ = 0;  // of the first run
  std::uint64_t sampled_until_us_ = 0;     // of the latest batch that arrived while no driver is at work, robot time
  bool is_resumed_ = false;
  bool had_control_ = false;
  std::uint32_t number_ = 0;
  std::vector<storage::ExperimentRun> begun_;
  std::vector<StepBegin> begins_;  // of the last drive
  runtime::Signal changed_;
};

}  // namespace server::experiments
