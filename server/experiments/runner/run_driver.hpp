// Drives a robot through one time line: sends what is due, watches, pauses, and leaves the robot at rest.
//
//   run() → starting → running ⇄ paused → at rest, and the way it ended
//
// SAFETY: it acts in the name of an actor, and is no sign of life itself. A duty in manual is renewed only while the
// client in whose hands the experiment is gives fresh ones for it; without them the robot is brought to rest. Whatever
// ends a run, the robot is at rest, or in emergency, or somebody else's, when run() returns.
//
// Interrupted: the link, a command, samples or a sign of life was late. The robot is at rest, and the run goes on when
// the same boot is back within `back_within`, was seen at rest since then, its client has given a sign of life since
// that, and kCountDown has passed; a pause by a person ends that. Where what is left would pass a limit from there, the
// robot goes back to 0 first, if the profile lets it (`way_back`), under the same conditions. A duty goes on at the
// tick where it was broken off, closed-loop steps begin again; what is left must keep within the limits from where the
// robot is. Not of an unattended one, and never after a stop, a latch, a limit, a taken control or another boot.
//
// The owner passes the station's reports on. Loop thread; what it is given outlives it, and so does it its own tasks:
// run() has returned, or the loop has ended.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <functional>
#include <map>
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
#include "server/storage/ingest/recorder.hpp"

namespace server::experiments {

inline constexpr microseconds kAbsence{3'000'000};          // in closed loop, without a sign of life
inline constexpr microseconds kCountDown{3'000'000};        // before it goes on by itself
inline constexpr microseconds kLongestPause{600'000'000};   // by a person
inline constexpr microseconds kTakeOverWithin{60'000'000};  // after control has gone to somebody else
inline constexpr int kMostBegins = 5;                       // of a closed-loop step, in one run
// Interruptions of a step that goes on: one for each of these seconds of its length, and kMostBegins in any case.
inline constexpr double kInterruptedEvery_s = 5;

// What the driver works with; outlives it.
struct DriverParts {
  boost::asio::io_context& loop;
  runtime::Clock& clock;
  runtime::TaskGroup& tasks;
  station::Station& station;
  microseconds back_within{10'000'000};  // after an interruption: link and client
};

struct DriveRequest {
  station::RobotId robot_id;
  std::string actor;                     // in whose name it commands
  std::string client;                    // and by which client's id
  std::string peer;                      // "experiment:7", by which its own commands are known
  bool is_unattended = false;            // SAFETY: of a line in auto alone
  microseconds auto_limit{600'000'000};  // longest time without a sign of life, if unattended
  std::optional<TimeLine> way_back{};  // to 0, in closed loop: by it an interrupted run may make room for what is left
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

// Whether what is left of a line keeps within its limits from this position; or why not, or why that is not known.
using TravelCheck = std::function<boost::asio::awaitable<Result<void>>(TimeLine rest, double position_m)>;

// What somebody else's command to the robot means for a run; `peer` is that of the run's own commands. None: nothing.
std::optional<Abort> disturbance_of(const station::CommandRecord& record, const std::string& peer);

class RunDriver {
 public:
  // The robot is at rest, and the actor controls it. `recorder` has its samples.
  RunDriver(const DriverParts& parts, const storage::Recorder& recorder, DriveRequest request, const Life& life,
            const AbortCriteria& criteria, TimeLine line, TravelCheck travel_check);

  boost::asio::awaitable<DriveEnd> run();  // returns when no task of its own is left

  // --- by people ---
  void pause(std::string reason, std::string detail);  // until resume(); kLongestPause at most; ends a count-down
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

  bool goes_back() const { return way_feed_.has_value(); }  // within its pause, until it is at rest again
  bool is_ending() const { return abort_.has_value(); }
  const Abort* pause_reason() const { return pause_ ? &pause_->shown : nullptr; }
  // By a person, or until one comes.
  const Abort* held_by() const { return pause_ && !pause_->ends_by_itself ? &pause_->why : nullptr; }
  std::optional<double> goes_on_in_s() const;  // in a count-down
  double elapsed_s() const;                    // of the line
  std::size_t step() const;                    // that runs now, of the line from 0
  double duration_s() const { return line_.duration_s(); }
  const std::vector<StepBegin>& step_begins() const { return begins_; }

 private:
  static constexpr microseconds kTurn{20'000};          // between two looks, if no sample comes
  static constexpr microseconds kBeginsAfter{500'000};  // more than kLookAhead

  struct Pause {
    Pause(Abort of, std::int64_t now_us, bool by_itself = false)
        : why{std::move(of)}, shown{why}, since_us{now_us}, ends_by_itself{by_itself} {}

    Abort why;
    Abort shown;                // with the count-down
    std::int64_t since_us = 0;  // steady
    bool is_resumed = false;
    bool ends_by_itself = false;     // an interruption
    std::int64_t goes_on_at_us = 0;  // steady; 0: not yet
    bool goes_back = false;          // to make room: what is late meanwhile is a pause of its own
  };

  // Of an interruption that begins, and of its end, by whatever way.
  struct InterruptionNote {
    InterruptionNote(RunDriver& of, Abort why);
    ~InterruptionNote();
    InterruptionNote(const InterruptionNote&) = delete;
    InterruptionNote& operator=(const InterruptionNote&) = delete;

    RunDriver& driver;
    Abort cause;
  };

  // Where the line was broken off.
  struct Place {
    std::size_t step = 0;
    std::uint64_t tick = 0;
  };

  boost::asio::awaitable<void> run_until_end();
  boost::asio::awaitable<void> stay_paused();
  boost::asio::awaitable<void> until_over_pause(std::uint64_t noticed_us);
  boost::asio::awaitable<void> check_travel(Place place);
  boost::asio::awaitable<bool> has_room_from_0(const TimeLine& rest, double position_m);
  boost::asio::awaitable<void> go_back();
  const CommandFeed& feed_now() const { return way_feed_ ? *way_feed_ : feed_; }
  boost::asio::awaitable<Rest> rest(bool ends_with_link);
  void go_on_from(Place place);
  void count_wait(std::int64_t since_us);
  void count_interruption(Place place);
  std::uint64_t broken_off(std::uint64_t noticed_us) const;
  Place place_of(std::uint64_t tick) const;
  void note_interruption(std::uint64_t from_robot_us, Abort cause) const;
  std::uint64_t shown_robot_us() const;
  void spawn(boost::asio::awaitable<void> task);
  void on_own_command(const station::CommandRecord& record);
  std::optional<Abort> unrecorded(const station::RobotState& robot) const;
  void begin_generation();
  void begin_at(Place place);
  void watch(const station::RobotState& robot);
  void watch_mode(const station::RobotState& robot);
  void watch_actor(const station::RobotState& robot);
  void feed(const station::RobotState& robot);
  void note_steps(std::uint64_t robot_now_us);
  void renew_lease();
  boost::asio::awaitable<void> send(FedCommand fed, std::uint64_t robot_now_us);
  boost::asio::awaitable<void> send_renewal(microseconds time_to_live);
  station::CommandRequest request_of(const protocol::Command& command) const;
  void interrupt(Abort why);
  void pause_for(Pause pause);
  bool is_over_pause(const station::RobotState& robot, bool is_seen);
  bool counts_down();
  void note_away(std::int64_t since_us);
  void watch_samples();
  Abort came_late(const std::string& kind) const;
  void check_pause_limit();
  bool is_in_control() const;  // its client
  bool has_control_again();
  void watch_control();
  bool is_fresh() const { return life_.is_fresh(parts_.clock.steady_us()); }
  std::uint64_t robot_now_us(const station::RobotState& robot) const;

  const DriverParts parts_;
  const storage::Recorder& recorder_;
  DriveRequest request_;
  const Life& life_;  // of the experiment
  TimeLine line_;
  AbortWatch watch_;
  CommandFeed feed_;
  std::optional<CommandFeed> way_feed_;  // while the robot goes back to 0
  std::optional<Abort> abort_;
  std::optional<Pause> pause_;
  const TravelCheck travel_check_;
  std::vector<StepBegin> begins_;
  std::size_t next_begin_ = 0;  // step whose beginning is noted next
  station::BootId boot_id_ = 0;
  std::uint64_t began_robot_us_ = 0;
  std::int64_t wrong_mode_since_us_ = 0;  // steady; 0: it is as it is to be
  std::int64_t renewed_at_us_ = 0;
  std::map<std::size_t, int> interruptions_;  // of each step
  std::int64_t interrupted_us_ = 0;           // in all
  bool has_lapsed_ = false;                   // control, with the signs of life of its client
  std::int64_t rested_at_us_ = 0;             // steady: seen at rest, in a pause
  std::uint64_t generation_robot_us_ = 0;     // when it began
  std::uint64_t paused_robot_us_ = 0;         // where the line was broken off; 0: it goes on
  std::optional<std::uint64_t> broken_off_;   // tick, once the robot has gone back meanwhile
  bool makes_room_ = false;                   // before it goes on the robot goes back to 0
  std::optional<Abort> no_room_;              // it cannot go on, as far as is known
  int ways_back_ = 0;                         // so far
  int rests_ordered_ = 0;                     // how often a pause or an interruption was asked for
  std::uint64_t seen_robot_us_ = 0;           // latest sample of this boot
  int link_losses_ = 0;
  std::uint64_t driven_robot_us_ = 0;      // latest sample of this boot with the motor on, or in auto
  int generation_ = 0;                     // of what was sent: a pause ends one
  std::set<station::CommandId> accepted_;  // commands of this generation that wait on the robot, or have acted
  int on_their_way_ = 0;                   // tasks of its own
  bool is_renewing_ = false;
  runtime::Signal changed_;
};

}  // namespace server::experiments
