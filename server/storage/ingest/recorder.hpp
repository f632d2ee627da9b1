// Records everything, always: hears the station, writes groups to disk, and says what has become durable.
//
//   Station → on_samples, on_event, on_command → queue → one transaction per 100 ms → set_on_durable's function
//
// A robot's samples are written when their segment is complete, or about 1 s old; events and commands with the next
// commit. Duplicates are dropped against what is stored and what waits. What the robot no longer holds is a gap, stored
// with its cause. A commit has at most kMaxCommitSamples; what is beyond goes in its turn with the next ones.
//
// Overflow: when the queue is full a batch is neither queued nor acknowledged; the robot still holds it, and it is
// asked for again (set_on_missing's function) once the queue has drained. Missing samples are asked for the same way.
// Events are asked for likewise. Commands beyond the limit, and what the station itself has to say, are counted and not
// recorded, but an emergency stop always is.
//
// A disk that fails (full, locked by another program) never ends the station: what could not be written is kept, not
// acknowledged, and tried again every second; everything behind it waits in the queue. Robots that are enrolled are
// admitted meanwhile: a new boot is stored with the next commit.
//
// Loop thread; SQL on the disk thread. The loop, the clock and the worker outlive it; runs and history use it. When it
// is destroyed no job of it may be under way, that is: the loop's run() has returned.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <deque>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <queue>
#include <set>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/worker.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/station_sink.hpp"
#include "server/storage/audit/audit_quota.hpp"
#include "server/storage/ingest/boot_recording.hpp"
#include "server/storage/ingest/checkpointer.hpp"

namespace server {

struct RecorderOptions {
  std::filesystem::path path;   // of the database
  LoopbackEnrolment enrolment;  // a new robot that connects from this machine is enrolled
  std::size_t max_queued_samples = 2'000'000;
  std::size_t max_queued_records = 100'000;   // events, commands, audit, clock estimates, texts in force
  std::uint64_t checkpoint_bytes = 64 << 20;  // of the write-ahead log, from which on it is moved into the database
  microseconds checkpoint_interval = std::chrono::seconds{10};  // after which a shorter one is moved, too
  microseconds head_interval = std::chrono::seconds{2};         // between two looks whether the head has changed
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
  std::uint64_t samples_refused = 0;     // not queued because the queue was full; each is asked for again
  std::uint64_t samples_lost = 0;        // in stored gaps
  std::uint64_t records_refused = 0;     // events and commands that the full queue did not take
  std::uint64_t events_asked_again = 0;  // requests
  std::uint64_t batches_malformed = 0;
  std::uint64_t commits = 0;
  std::uint64_t largest_commit_samples = 0;
  std::uint64_t commits_failed = 0;  // each was, or is being, tried again
};

class Recorder final : public StationSink, public RobotArchive {
 public:
  static constexpr std::size_t kMaxCommitSamples = 200'000;

  using OnDurable = std::function<void(const RobotId&, BootId, std::uint64_t next_seq, std::uint64_t next_event_seq)>;
  using OnMissing = std::function<void(const RobotId&, BootId, std::uint64_t first_seq, std::uint64_t next_seq)>;
  using OnMissingEvents = std::function<void(const RobotId&, BootId)>;

  Recorder(boost::asio::io_context& loop, Clock& clock, WorkerThread& disk, WorkerThread& checkpoints,
           RecorderOptions options);
  ~Recorder() override;

  void set_on_durable(OnDurable on_durable) { on_durable_ = std::move(on_durable); }
  void set_on_missing(OnMissing on_missing) { on_missing_ = std::move(on_missing); }
  void set_on_missing_events(OnMissingEvents on_missing) { on_missing_events_ = std::move(on_missing); }

  // Opens or creates the database; before everything else. Throws when the file is not ours or cannot be written.
  boost::asio::awaitable<RestoredState> open();

  // Commits and asks for what is missing, until cancelled.
  boost::asio::awaitable<void> run();
  // Moves the write-ahead log into the database meanwhile, until cancelled.
  boost::asio::awaitable<void> run_checkpoints() { return checkpointer_.run(); }

  // Returns after a commit (Checkpointer::next_commit).
  boost::asio::awaitable<void> next_commit() { return checkpointer_.next_commit(); }

  // Return true when what they name, as far as it was heard, is durable, and false after 3 s if it is not yet. Need
  // run(). Those of samples cut segments short; whoever only reads samples joins waiting() instead.
  boost::asio::awaitable<bool> flush();          // everything: the segments of every robot are cut
  boost::asio::awaitable<bool> flush(BootId);    // the samples and gaps of one boot; nothing is written if none wait
  boost::asio::awaitable<bool> flush_records();  // events, commands and boots
  boost::asio::awaitable<bool> flush_boots();    // boots and the spans that they moved; nothing is written if none wait

  // After the loop has ended: writes and commits everything left, or logs what could not be written; then `last` has
  // the database to itself. Does not throw.
  void close(const std::function<void(Database&, std::int64_t utc_us)>& last = {});

  boost::asio::awaitable<Admission> admit(AdmissionRequest request) override;

  // A robot whose enrolment was revoked is refused from this call on, also one that is being admitted.
  void set_revoked(const RobotId& robot_id, bool revoked);

  void on_robot(const RobotState& robot) override;
  void on_fluid(const RobotState& robot) override;
  void on_samples(const RobotState& robot, const SampleBatch& batch) override;
  void on_unusable_samples(const RobotState& robot, std::uint64_t first_seq, std::uint64_t next_seq) override;
  void on_unusable_event(const RobotState& robot, std::uint64_t event_seq) override;
  void on_event(const RobotState& robot, const RobotEvent& event) override;
  void on_command(const CommandRecord& command) override;
  // Written with the next commit; what can flood is bounded by an AuditQuota.
  void on_audit(const AuditNote& note) override;
  void on_clock(const RobotState& robot, const ClockRecord& record) override;
  void on_in_force(const RobotState& robot, const InForceRecord& record) override;

  // Runs job(Database&) on the disk thread, between two commits.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job, Database&>> on_disk(Job job) {
    LogReport report{checkpointer_};
    auto with_database = [this, &report, job = std::move(job)]() mutable {
      const LogReport::Reading reading{report.use, *store_};
      return job(*database_);
    };
    co_return co_await disk_.run(std::move(with_database));
  }

  // One above the newest sample that a boot is known to have made; 0 when the boot is not in use.
  std::uint64_t next_seq(BootId boot_id) const;

  // What was heard of a boot and is not durable yet, ascending, in the form in which it will be read back: its samples,
  // cut to the range, and its gaps in it. Of the samples those of the first segments that have `limit` together, since
  // hours may wait. A reader takes both before it asks the database; what it then finds in both it takes from there.
  // Nothing is missing so, since what was durable before is in every later read transaction.
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  std::vector<Segment> waiting(BootId boot_id, Interval samples, std::size_t limit = kAll) const;
  std::vector<LostRange> waiting_gaps(BootId boot_id, Interval samples) const;

  boost::asio::io_context& loop() { return loop_; }
  const std::filesystem::path& path() const { return options_.path; }
  const RecorderCounters& counters() const { return counters_; }
  std::size_t queued_samples() const { return queued_samples_; }
  // The last commit failed: nothing becomes durable now.
  bool failing() const { return retry_at_us_ != 0; }
  std::size_t flushes() const { return flushes_.size(); }  // who waits for a commit
  const WalState& wal() const { return checkpointer_.state(); }
  const std::string& problem() const { return problem_; }  // while it is failing: why, and what to do

 private:
  struct Boot {
    explicit Boot(RobotId robot_id) : recording{std::move(robot_id)} {}
    BootRecording recording;
    bool connected = false;
    bool started = false;                   // has been connected
    bool replaced = false;                  // a later boot of this robot has connected
    int admissions = 0;                     // under way
    std::int64_t last_used_us = 0;          // steady time of the last admission
    std::optional<AdmissionRequest> hello;  // admitted, and not connected since

    bool is_due = false;             // is in due_
    bool is_ageing = false;          // is in ageing_
    bool has_records = false;        // is in with_records_
    bool has_hole = false;           // is in with_holes_
    bool is_written = false;         // is in writing_boots_
    std::size_t in_line = 0;         // its segments in line_
    std::size_t starts_waiting = 0;  // in starts_ or writing_.boots
  };
  using Boots = std::unordered_map<BootId, Boot>;  // an entry stays where it is
  using BootEntry = Boots::value_type;

  // A coroutine waits until everything before it is stored, or does no longer.
  struct Flush {
    std::weak_ptr<Signal> done;
    std::uint64_t after = 0;  // so many segments have left the line
    bool is_taken = false;    // what is not in the line has gone into a commit
  };

  // A boot has connected. It is stored once the samples of the robot's earlier boots are.
  struct WaitingStart {
    BootStart start;
    std::uint64_t after = 0;  // so many segments have left the line
  };

  // A robot asks to be let in, and waits for the answer. Shared with it, since it may go.
  struct Asked {
    Asked(boost::asio::io_context& loop, AdmissionQuestion asks) : question{std::move(asks)}, told{loop} {}
    AdmissionQuestion question;
    std::optional<AdmissionOutcome> outcome;
    Signal told;
  };
  struct AskingTurn {
    explicit AskingTurn(Recorder& of) : recorder{of} { recorder.is_asking_ = true; }
    ~AskingTurn();
    AskingTurn(const AskingTurn&) = delete;
    AskingTurn& operator=(const AskingTurn&) = delete;
    Recorder& recorder;
  };

  struct Ageing {
    std::int64_t due_us = 0;  // steady
    BootEntry* boot = nullptr;
    bool operator>(const Ageing& other) const { return due_us > other.due_us; }
  };

  // After a job of the disk thread, whatever came of it: tells how long the log is.
  struct LogReport {
    explicit LogReport(Checkpointer& to) : checkpointer{to} {}
    ~LogReport() {
      if (use) checkpointer.on_log(*use);  // else it was cancelled before it began
    }
    LogReport(const LogReport&) = delete;
    LogReport& operator=(const LogReport&) = delete;

    struct Reading {  // on the disk thread
      std::optional<LogUse>& use;
      const SampleStore& store;
      ~Reading() { use = store.log_use(); }
    };

    Checkpointer& checkpointer;
    std::optional<LogUse> use;
  };

  boost::asio::awaitable<AdmissionOutcome> ask(AdmissionQuestion question);
  boost::asio::awaitable<void> wait_for_commit();
  boost::asio::awaitable<void> finish_checkpoint();
  boost::asio::awaitable<void> write();
  std::string try_to_write();  // the problem, empty when writing_ is durable
  void note_failure(const std::string& problem);
  boost::asio::awaitable<bool> flush_after(std::uint64_t segments);  // have left the line
  void end_flushes();
  void watch(BootEntry& entry);
  void line_up(BootEntry& entry, bool all);
  void line_up_due();
  void line_up_everything();
  void take();
  void take_from_line();
  void take_records();
  void add_to_commit(BootEntry& entry);
  void count_written(const WriteBatch& written);
  boost::asio::awaitable<void> tell_durable(std::vector<BootProgress> progress);
  boost::asio::awaitable<void> ask_for_missing();
  void forget_unused();
  bool is_unused(const Boot& boot) const;
  bool another_starts(const AdmissionRequest& request, std::int64_t since_us) const;
  Admission take_in(BootEntry& entry, AdmissionOutcome outcome, const AdmissionRequest& request);
  void add_boot(BootEntry& entry, StoredBoot stored, const AdmissionRequest& request);
  void replace_others(const RobotId& robot_id, BootId boot_id);
  void wake();
  std::size_t queued_records() const {
    return queue_.events.size() + queue_.commands.size() + queue_.audit.size() + queue_.clocks.size() +
           queue_.in_force.size();
  }
  bool room_for_record();
  void tell_left_out(bool at_once);
  std::int64_t key_of(BootId boot_id) const;
  BootEntry* recorded(BootId boot_id);

  boost::asio::io_context& loop_;
  Clock& clock_;
  WorkerThread& disk_;
  RecorderOptions options_;
  OnDurable on_durable_;
  OnMissing on_missing_;
  OnMissingEvents on_missing_events_;

  std::unique_ptr<Database> database_;  // used by jobs; by close() when no job can be under way
  std::unique_ptr<SampleStore> store_;

  Checkpointer checkpointer_;

  std::deque<std::shared_ptr<Asked>> asked_;  // as many as the robot port greets at most
  bool is_asking_ = false;
  std::set<RobotId> revoked_;  // as in the database, or newer; all of them were enrolled

  Boots boots_;
  std::unordered_map<std::int64_t, BootEntry*> by_key_;
  std::unordered_multimap<RobotId, BootEntry*> by_robot_;  // as by_key_, those that are loaded
  std::int64_t next_boot_key_ = 0;
  std::int64_t restored_at_us_ = 0;  // UTC; 0: the database is not made of a backup

  // Boots that have something to write, or to ask for, so that nobody looks at all of them each 100 ms.
  std::deque<BootEntry*> due_;  // with a complete segment, or not connected
  std::priority_queue<Ageing, std::vector<Ageing>, std::greater<>> ageing_;
  std::vector<BootEntry*> with_records_;
  std::deque<BootEntry*> with_holes_;

  std::deque<Segment> line_;  // go to the disk in this order
  std::size_t line_samples_ = 0;
  std::uint64_t lined_up_ = 0;  // segments, ever
  std::uint64_t left_line_ = 0;
  std::deque<WaitingStart> starts_;
  WriteBatch queue_;                                            // records; segments are in their boot or in line
  WriteBatch writing_;                                          // being written; kept until it is durable
  std::vector<BootEntry*> writing_boots_;                       // in the order of its progress
  std::unordered_map<CommandId, std::size_t> queued_commands_;  // where each waits in queue_.commands
  std::size_t queued_samples_ = 0;
  AuditQuota quota_;
  RecorderCounters counters_;
  std::int64_t last_commit_us_ = 0;      // steady
  std::int64_t retry_at_us_ = 0;         // steady; 0 unless the last commit failed
  std::string problem_;                  // of that commit
  std::int64_t failure_logged_us_ = 0;   // steady
  std::int64_t overflow_logged_us_ = 0;  // steady
  std::int64_t next_forget_us_ = 0;      // steady
  std::size_t replaced_boots_ = 0;
  bool forget_at_once_ = false;  // a boot was refused
  bool idle_ = false;            // run() waits for work_

  Signal work_{loop_};  // something to record, or a robot to watch
  Signal flush_wanted_{loop_};
  std::vector<Flush> flushes_;
};

}  // namespace server
