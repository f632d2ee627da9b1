// The experiments of the station: a queue for each robot, of which one at a time is conducted.
//
//   begin() → waiting → running ⇄ paused → done or aborted          every state is a row on disk; cancel() ends a
//   waiting one
//
// SAFETY: nothing begins by itself. An experiment begins when the client in whose hands it is (the page or the script
// that began it, or took it over) says keep_alive() for this experiment, and nobody else controls the robot, or has
// reserved it for that time. What waits is held until somebody resumes it: after an abort, after a restart of the
// station, and when its client has been away for kHeldAfter. At most kMostQueued wait. Abort, and
// what ends one, leaves the robot at rest. Loop thread; what it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/config/experiment_rules.hpp"
#include "server/experiments/runner/conduct.hpp"
#include "server/runtime/ended_right.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/recording_parts.hpp"

namespace server::experiments {

inline constexpr std::size_t kMostQueued = 200;
inline constexpr std::size_t kMaxProfileBytes = 32'000;
inline constexpr microseconds kHeldAfter{60'000'000};
inline constexpr microseconds kAwayFor{10'000'000};

struct ExperimentProgress {
  std::uint32_t run = 0, runs = 0;       // from 1
  std::size_t step = 0, steps = 0;       // from 1
  double elapsed_s = 0, duration_s = 0;  // of the run
  std::optional<double> goes_on_in_s{};  // in the count-down after an interruption
};

// What is known of one now. A summary has the counts of its runs, and no run.
struct ExperimentView {
  storage::Experiment experiment;
  std::string waits_for;  // of a waiting one, for programs: nobody_present, robot_not_at_rest, …; empty: its turn
  std::string waits_for_detail;
  std::optional<ExperimentProgress> progress;  // of one that runs
  std::string activity{};                      // what is done between two runs, in words; or empty
};

class Experiments final : public station::StationSink {
 public:
  // It receives the reports of the station from now on.
  Experiments(const DriverParts& parts, storage::RecordingParts& recording, runtime::WorkerThread& maths,
              const config::ExperimentRules& rules);
  ~Experiments() override;

  void set_controller_by_name(ControllerByName by_name) { controller_by_name_ = std::move(by_name); }
  void set_fit_of_runs(FitOfRuns fit) { fit_of_runs_ = std::move(fit); }
  using OnChange = std::function<void(const ExperimentView& summary)>;
  void set_on_change(OnChange on_change) { on_change_ = std::move(on_change); }  // and once a second while one runs

  boost::asio::awaitable<void> run();  // until cancelled; before it nothing is begun

  // At the end of the robot's queue, on disk. invalid: what the profile or the station's limits say against it;
  // forbidden: unattended where the configuration does not allow it; not_found; unavailable: too many wait.
  // `seen_at_us`, as below: steady time of what the sender saw, for which the request is a sign of life; none: it is
  // none. SAFETY: however long it takes until the disk has it, the sign is as old as the request.
  boost::asio::awaitable<Result<ExperimentView>> begin(storage::ExperimentRequest request, station::Author by,
                                                       std::optional<std::int64_t> seen_at_us = {});

  // A sign of life for one experiment, and for control of its robot. `age`: of what the client saw of the robots.
  // SAFETY: of another client than the one in whose hands the experiment is it is none. False then.
  bool keep_alive(storage::ExperimentId id, const station::Client& client, microseconds age);
  const Life* life_of(storage::ExperimentId id) const;  // null: it is not known, or has ended

  boost::asio::awaitable<Result<ExperimentView>> find(storage::ExperimentId id);
  boost::asio::awaitable<std::vector<ExperimentView>> list(storage::ExperimentFilter filter);  // summaries
  boost::asio::awaitable<std::optional<std::string>> prediction(storage::ExperimentId id, std::uint32_t number);
  // As find(), once its state is another one than `known`, or so much later.
  boost::asio::awaitable<Result<ExperimentView>> wait_for_change(storage::ExperimentId id, microseconds patience);

  // By people. not_found; conflict: its state forbids it. Each is in the audit.
  boost::asio::awaitable<Result<ExperimentView>> pause(storage::ExperimentId id, station::Author by);
  // It comes into the hands of the caller's client if its own has been away for kAwayFor.
  boost::asio::awaitable<Result<ExperimentView>> resume(storage::ExperimentId id, station::Author by,
                                                        std::optional<std::int64_t> seen_at_us = {});
  boost::asio::awaitable<Result<ExperimentView>> abort(storage::ExperimentId id, std::string reason,
                                                       station::Author by);
  // It is in the hands of the caller's client from now on. conflict while somebody else controls the robot.
  boost::asio::awaitable<Result<ExperimentView>> take_over(storage::ExperimentId id, station::Author by,
                                                           std::optional<std::int64_t> seen_at_us = {});
  // Before another one of its robot's queue (0: to its end), with this priority.
  boost::asio::awaitable<Result<ExperimentView>> move(storage::ExperimentId id, storage::ExperimentId before,
                                                      std::int64_t priority, station::Author by);
  // Without its runs; none: it is not known, or has ended.
  std::optional<ExperimentView> summary(storage::ExperimentId id) const;

  std::set<std::string> acting() const;  // in whose names experiments run or wait

  void on_samples(const station::RobotState& robot, const station::SampleBatch& batch) override;
  void on_robot(const station::RobotState& robot) override;
  void on_command(const station::CommandRecord& record) override;
  void on_event(const station::RobotState& robot, const station::RobotEvent& event) override;
  void on_stop_again(const station::CommandRecord& in_force) override;
  void on_right_ended(const runtime::EndedRight& right) override;
  bool watches(const station::RobotId& robot_id) const override { return running_.contains(robot_id); }

 private:
  struct Entry {
    storage::Experiment experiment;
    Profile profile;
    Life life;
    std::string waits_for, waits_for_detail;
    std::unique_ptr<Conduct> conduct;  // null: it waits
    std::optional<Abort> end;          // of a conduct that has ended, or is not to begin
    bool has_ended = false;
    bool is_unreadable = false;  // its profile is of another version
    bool is_changed = false;     // and the database does not know it yet
  };

  // Why one does not begin yet: for programs, and in words; empty: it is its turn.
  struct WaitReason {
    std::string reason, detail;
  };

  struct Hold {
    std::uint64_t count = 0;
    const char* reason = "";  // of the last
  };

  // A document that was read, on the worker.
  struct Prepared {
    Profile profile;
    std::uint32_t runs = 0;
    double duration_s = 0;
    Demands demands;
  };
  static Result<Prepared> prepare(const std::string& document, const config::Envelope& envelope,
                                  const std::string& fluid);

  boost::asio::awaitable<void> load();
  boost::asio::awaitable<void> admit(std::vector<storage::Experiment> waiting);  // that an earlier start has left
  boost::asio::awaitable<void> carry_out(storage::ExperimentId id);
  boost::asio::awaitable<void> conduct(Entry& entry);
  boost::asio::awaitable<void> finish(Entry& entry);
  boost::asio::awaitable<void> hold_queue(station::RobotId robot_id);
  boost::asio::awaitable<void> keep_if_it_can_be(std::string what, std::function<void(storage::Database&)> change);
  boost::asio::awaitable<void> store_states(std::vector<storage::Experiment> changed);
  void hold_after_stop(const station::RobotId& robot_id);
  std::vector<storage::Experiment> hold_all(const station::RobotId& robot_id, const char* reason);
  void note_states();
  void spawn(const std::string& name, boost::asio::awaitable<void> task);
  void begin_what_may();
  void hold_what_is_left_alone();
  static void end_in_nobodys_name(Entry& entry, Abort why);
  storage::Experiment take_out(storage::ExperimentId id, std::string reason, std::string detail);
  boost::asio::awaitable<void> store_end(storage::Experiment ended, station::AuditNote note);
  void put_into_hands_of(Entry& entry, const station::Client& client, std::optional<std::int64_t> seen_at_us);
  Result<void> take_control_for(const Entry& entry, const station::Client& client, const std::string& peer);
  WaitReason wait_reason_of(const Entry& entry) const;
  WaitReason reserved_for_another(const storage::Experiment& experiment) const;  // empty: it is not, or not that soon
  void abort_if_reserved(const station::RobotId& robot_id);
  std::vector<Entry*> queue_of(const station::RobotId& robot_id);
  Entry* entry_of(storage::ExperimentId id);
  boost::asio::awaitable<Result<ExperimentView>> refuse(storage::ExperimentId id, const char* what);
  Result<void> check_request(const storage::ExperimentRequest& request) const;
  storage::ExperimentState state_of(const Entry& entry) const;
  ExperimentView summary_of(const Entry& entry) const;
  ExperimentView view_of(const Entry& entry) const;
  station::AuditNote note_of(const Entry& entry, const char* what, const station::Author& by) const;
  boost::asio::awaitable<Result<ExperimentView>> stored(storage::ExperimentId id, station::AuditNote note);
  void publish(const Entry& entry);
  Conduct* conduct_of(const station::RobotId& robot_id);

  const DriverParts parts_;
  storage::RecordingParts& recording_;
  runtime::WorkerThread& maths_;
  const bool allow_unattended_;
  StubbornWriter writer_;
  ControllerByName controller_by_name_;
  FitOfRuns fit_of_runs_;
  OnChange on_change_ = [](const ExperimentView&) {};
  std::map<storage::ExperimentId, Entry> entries_;             // that have not ended
  std::map<station::RobotId, storage::ExperimentId> running_;  // of each robot at most one
  std::map<station::RobotId, Hold> holds_;                     // of all that waited for a robot
  std::map<station::RobotId, std::int64_t> commanded_at_us_;   // steady, when a person last commanded a robot
  RestsOwed rests_;
  bool is_storing_ = false;
  bool is_loaded_ = false;
  runtime::RequestsOnTheirWay being_added_;
  runtime::Signal wake_;
  runtime::Signal changed_;
};

}  // namespace server::experiments
