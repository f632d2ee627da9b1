// Records everything, always: hears the station, writes groups to disk, and says what has become durable.
//
//   Station → on_samples, on_event, on_command → queue → one transaction per 100 ms → set_on_durable's function
//
// A robot's samples are written when they are 100, or 1 s old; events and commands with the next commit. Duplicates
// are dropped against what is stored and what waits. What the robot no longer holds is a gap, stored with its cause.
//
// Overflow: when the queue is full a batch is neither queued nor acknowledged; the robot still holds it, and it is
// asked for again (set_on_missing's function) once the queue has drained. Missing samples are asked for the same way.
// Events and commands beyond the limit are counted and not recorded, but an emergency stop always is.
//
// A disk that fails (full, locked by another program) never ends the station: what could not be written is kept, not
// acknowledged, and tried again every second; everything behind it waits in the queue.
//
// Loop thread; SQL on the disk thread. The loop, the clock and the worker outlive it; runs and history use it. When it
// is destroyed no job of it may be under way, that is: the loop's run() has returned.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/clock.hpp"
#include "server/recording/boot_recording.hpp"
#include "server/station/robot_archive.hpp"
#include "server/station/station_sink.hpp"
#include "server/worker.hpp"

namespace server {

struct RecorderOptions {
  std::filesystem::path path;     // of the database
  bool enrol_on_loopback = true;  // a new robot that connects from this machine is enrolled
  std::size_t max_queued_samples = 2'000'000;
  std::size_t max_queued_records = 100'000;  // events and commands
};

// What the station must know again after a restart.
struct RestoredState {
  std::uint64_t store_id = 0;
  std::vector<RestoredRobot> robots;
  std::vector<CommandRecord> pending_stops;  // emergency stops that no robot has acknowledged
};

// Since the start of the program.
struct RecorderCounters {
  std::uint64_t samples_written = 0;
  std::uint64_t samples_duplicate = 0;
  std::uint64_t samples_refused = 0;  // not queued because the queue was full; each is asked for again
  std::uint64_t samples_lost = 0;     // in stored gaps
  std::uint64_t records_refused = 0;  // events and commands that the full queue did not take
  std::uint64_t batches_malformed = 0;
  std::uint64_t commits = 0;
  std::uint64_t commits_failed = 0;  // each was, or is being, tried again
};

class Recorder final : public StationSink, public RobotArchive {
 public:
  using OnDurable = std::function<void(const RobotId&, BootId, std::uint64_t next_seq, std::uint64_t next_event_seq)>;
  using OnMissing = std::function<void(const RobotId&, BootId, std::uint64_t first_seq, std::uint64_t next_seq)>;

  Recorder(boost::asio::io_context& loop, Clock& clock, WorkerThread& disk, RecorderOptions options);
  ~Recorder() override;

  void set_on_durable(OnDurable on_durable) { on_durable_ = std::move(on_durable); }
  void set_on_missing(OnMissing on_missing) { on_missing_ = std::move(on_missing); }

  // Opens or creates the database; before everything else. Throws when the file is not ours or cannot be written.
  boost::asio::awaitable<RestoredState> open();

  // Commits and asks for what is missing, until cancelled.
  boost::asio::awaitable<void> run();

  // Return true when what they name, as far as it was heard, is durable, and false after 3 s if it is not yet. Need
  // run(). Those of samples cut segments short; whoever only reads samples joins waiting() instead.
  boost::asio::awaitable<bool> flush();          // everything: the segments of every robot are cut
  boost::asio::awaitable<bool> flush(BootId);    // the samples and gaps of one boot; nothing is written if none wait
  boost::asio::awaitable<bool> flush_records();  // events, commands and boots
  boost::asio::awaitable<bool> flush_boots();    // boots and the spans that they moved; nothing is written if none wait

  // After the loop has ended: writes and commits everything left, or logs what could not be written. Does not throw.
  void close();

  boost::asio::awaitable<Admission> admit(AdmissionRequest request) override;

  void on_robot(const RobotState& robot) override;
  void on_samples(const RobotState& robot, const SampleBatch& batch) override;
  void on_event(const RobotState& robot, const RobotEvent& event) override;
  void on_command(const CommandRecord& command) override;

  // Runs job(Database&) on the disk thread, between two commits.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job, Database&>> on_disk(Job job) {
    auto with_database = [this, job = std::move(job)]() mutable { return job(*database_); };
    co_return co_await disk_.run(std::move(with_database));
  }

  // One above the newest sample that a boot is known to have made; 0 when the boot is not in use.
  std::uint64_t next_seq(BootId boot_id) const;

  // What was heard of a boot and is not durable yet, ascending, in the form in which it will be read back: its samples,
  // cut to the range, and its gaps. A reader takes both before it asks the database; what it then finds in both it
  // takes from there. Nothing is missing so, since what was durable before is in every later read transaction.
  std::vector<Segment> waiting(BootId boot_id, Interval samples) const;
  std::vector<LostRange> waiting_gaps(BootId boot_id) const;

  boost::asio::io_context& loop() { return loop_; }
  const std::filesystem::path& path() const { return options_.path; }
  const RecorderCounters& counters() const { return counters_; }
  std::size_t queued_samples() const { return queued_samples_; }
  // The last commit failed: nothing becomes durable now.
  bool failing() const { return retry_at_us_ != 0; }
  const std::string& problem() const { return problem_; }  // while it is failing: why, and what to do

 private:
  struct Boot {
    explicit Boot(RobotId robot_id) : recording{std::move(robot_id)} {}
    BootRecording recording;
    bool connected = false;
    bool started = false;            // has been connected
    bool replaced = false;           // a later boot of this robot has connected
    int admissions = 0;              // under way
    std::int64_t last_used_us = 0;   // steady time of the last admission
    std::optional<BootStart> hello;  // admitted, and not connected since
    std::uint64_t hello_oldest_seq = 0;
  };
  using Boots = std::map<BootId, Boot>;

  // A coroutine waits until everything before it is stored, or does no longer.
  struct Flush {
    std::weak_ptr<Signal> done;
    bool everything = false;        // the samples of all boots, too
    std::optional<BootId> boot_id;  // the samples of this boot, too
  };

  boost::asio::awaitable<void> wait_for_commit();
  boost::asio::awaitable<void> write();
  std::string try_to_write();  // the problem, empty when writing_ is durable
  void note_failure(const std::string& problem);
  boost::asio::awaitable<bool> flush(bool everything, std::optional<BootId> boot_id);
  void take_for(const std::vector<Flush>& flushes);
  void take(bool everything, const std::set<BootId>& flushed = {});
  void set_durable(const WriteBatch& written);
  void ask_for_missing();
  void forget_unused();
  Admission take_in(Boot& boot, AdmissionOutcome outcome, const AdmissionRequest& request);
  void replace_others(const RobotId& robot_id, BootId boot_id);
  void wake();
  bool room_for_record();

  boost::asio::io_context& loop_;
  Clock& clock_;
  WorkerThread& disk_;
  RecorderOptions options_;
  OnDurable on_durable_;
  OnMissing on_missing_;

  std::unique_ptr<Database> database_;  // used by jobs; by close() when no job can be under way
  std::unique_ptr<SampleStore> store_;

  Boots boots_;
  WriteBatch queue_;                                            // all but samples, which wait in their boot
  WriteBatch writing_;                                          // being written; kept until it is durable
  std::unordered_map<CommandId, std::size_t> queued_commands_;  // where each waits in queue_.commands
  std::size_t queued_samples_ = 0;
  RecorderCounters counters_;
  std::int64_t last_commit_us_ = 0;      // steady
  std::int64_t retry_at_us_ = 0;         // steady; 0 unless the last commit failed
  std::string problem_;                  // of that commit
  std::int64_t failure_logged_us_ = 0;   // steady
  std::int64_t overflow_logged_us_ = 0;  // steady
  bool idle_ = false;                    // run() waits for work_

  Signal work_{loop_};  // something to record, or a robot to watch
  Signal flush_wanted_{loop_};
  std::vector<Flush> flushes_;
};

}  // namespace server
