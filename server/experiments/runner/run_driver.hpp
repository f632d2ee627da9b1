// Drives a robot through one time line: sends what is due, watches, pauses, and leaves the robot at rest.
//
//   run() → starting → running ⇄ paused → at rest, and the way it ended
//
// SAFETY: it acts in the name of an actor, and is no sign of life itself. A duty in manual is renewed only while the
// client in whose hands the experiment is gives fresh ones for it; without them the robot is brought to rest, and the
// step is repeated when the client is back within kAbsence, or the run ends. Whatever ends a run, the robot is at rest,
// or in emergency, or somebody else's, when run() returns.
//
// The owner passes the station's reports on. Loop thread; what it is given outlives it, and so does it its own tasks:
// run() has returned, or the loop has ended.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/experiments/runner/abort_watch.hpp"
#include "server/experiments/runner/command_feed.hpp"
#include "server/experiments/runner/life.hpp"
#include "server/experiments/runner/robot_rest.hpp"
#include "server/runtime/tasks.hpp"
#include "server/station/station.hpp"

namespace server::experiments {

inline constexpr microseconds kAbsence{3'000'000};          // of a page that is loaded again
inline constexpr microseconds kLongestPause{600'000'000};   // by a person
inline constexpr microseconds kTakeOverWithin{60'000'000};  // after control has gone to somebody else
inline constexpr int kMostRepeats = 5;                      // of steps, in one run

// What the driver works with; outlives it.
struct DriverParts {
  boost::asio::io_context& loop;
  runtime::Clock& clock;
  runtime::TaskGroup& tasks;
  station::Station& station;
};

struct DriveRequest {
  station::RobotId robot_id;
  std::string actor;                     // in whose name it commands
  std::string client;                    // and by which client's id
  std::string peer;                      // "experiment:7", by which its own commands are known
  bool is_unattended = false;            // SAFETY: of a line in auto alone
  microseconds auto_limit{600'000'000};  // longest time without a sign of life, if unattended
};

struct DriveEnd {
  std::optional<Abort> abort;  // none: it came to its end
  Rest rest = Rest::at_rest;
};

// When a step began, in the time of the robot; a repeated one again.
struct StepBegin {
  std::size_t step = 0;
  std::uint64_t robot_time_us = 0;
};

// What somebody else's command to the robot means for a run; `peer` is that of the run's own commands. None: nothing.
std::optional<Abort> disturbance_of(const station::CommandRecord& record, const std::string& peer);

class RunDriver {
 public:
  // The robot is at rest, and the actor controls it.
  RunDriver(const DriverParts& parts, DriveRequest request, const Life& life, const AbortCriteria& criteria,
            TimeLine line);

  boost::asio::awaitable<DriveEnd> run();  // returns when no task of its own is left

  // --- by people ---
  void pause(std::string reason, std::string detail);  // until resume(); kLongestPause at most
  void resume();
  void abort(Abort why);
  void set_client(const station::Client& client) {
    request_.actor = client.actor;
    request_.client = client.id;
  }

  // --- the station's reports, of this robot alone ---
  void on_samples(const station::SampleBatch& batch);
  void on_robot(const station::RobotState& robot);
  void on_command(const station::CommandRecord& record);
  void on_event(const station::RobotEvent& event);
  // After run() has thrown: returns when no task of its own is left.
  boost::asio::awaitable<void> settle_tasks();

  bool is_paused() const { return pause_.has_value(); }
  const Abort* pause_reason() const { return pause_ ? &pause_->why : nullptr; }
  double elapsed_s() const;  // of the line
  std::size_t step() const;  // that runs now, of the line from 0
  double duration_s() const { return line_.duration_s(); }
  const std::vector<StepBegin>& step_begins() const { return begins_; }

 private:
  struct Pause {
    Abort why;
    std::int64_t since_us = 0;  // steady
    bool is_resumed = false;
    bool ends_by_itself = false;  // when the actor is back
  };

  boost::asio::awaitable<void> run_until_end();
  boost::asio::awaitable<void> stay_paused();
  boost::asio::awaitable<Rest> rest();
  void spawn(boost::asio::awaitable<void> task);
  void on_own_command(const station::CommandRecord& record);
  void begin_generation();
  void begin_at(std::size_t step);
  void watch(const station::RobotState& robot);
  void watch_mode(const station::RobotState& robot);
  void watch_actor(const station::RobotState& robot);
  void feed(const station::RobotState& robot);
  void note_steps(std::uint64_t robot_now_us);
  void renew_lease();
  boost::asio::awaitable<void> send(FedCommand fed, std::uint64_t robot_now_us);
  boost::asio::awaitable<void> send_renewal(microseconds time_to_live);
  station::CommandRequest request_of(const protocol::Command& command) const;
  void pause_for(Pause pause);
  bool is_over_pause(const station::RobotState& robot);
  void check_pause_limit();
  bool is_in_control() const;  // its client
  bool is_fresh() const { return life_.is_fresh(parts_.clock.steady_us()); }
  std::uint64_t robot_now_us(const station::RobotState& robot) const;

  const DriverParts parts_;
  DriveRequest request_;
  const Life& life_;  // of the experiment
  TimeLine line_;
  AbortWatch watch_;
  CommandFeed feed_;
  std::optional<Abort> abort_;
  std::optional<Pause> pause_;
  std::vector<StepBegin> begins_;
  std::size_t next_begin_ = 0;  // step whose beginning is noted next
  station::BootId boot_id_ = 0;
  std::uint64_t began_robot_us_ = 0;
  std::int64_t wrong_mode_since_us_ = 0;  // steady; 0: it is as it is to be
  std::int64_t renewed_at_us_ = 0;
  int repeats_ = 0;
  int generation_ = 0;                     // of what was sent: a pause ends one
  std::set<station::CommandId> accepted_;  // commands of this generation that wait on the robot, or have acted
  int on_their_way_ = 0;                   // tasks of its own
  bool is_renewing_ = false;
  runtime::Signal changed_;
};

}  // namespace server::experiments
