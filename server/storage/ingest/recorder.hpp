// Records everything, always: receives what the station reports, writes it in groups, and reports what is durable.
//
//   Station → on_samples, on_event, on_command → queue → one transaction per 100 ms → set_on_durable's function
//
// This class is the loop between its parts: RobotAdmission asks the database who may connect, BootRegistry knows the
// boots and what is to be done with each, CommitQueue what is written next, DatabaseWorker writes it.
//
// A robot's samples are written when their segment is complete, or about 1 s old; events and commands with the next
// commit. Duplicates are dropped against what is stored and what waits. What the robot no longer holds is a gap, stored
// with its cause. A commit has at most kMaxCommitSamples; what is beyond goes in its turn with the next ones.
//
// Overflow: when the queue is full a batch is neither queued nor acknowledged; the robot still holds it, and it is
// asked for again (set_on_missing's function) once the queue has drained. Missing samples are asked for the same way.
// So are events. Commands beyond the limit, and what the station itself reports, are counted and not
// recorded, but an emergency stop always is, and where an experiment waited: a full queue has room for
// kMostInterruptions of these.
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
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/histogram.hpp"
#include "server/runtime/worker.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/station_sink.hpp"
#include "server/storage/audit/audit_quota.hpp"
#include "server/storage/commits/checkpointer.hpp"
#include "server/storage/commits/database_worker.hpp"
#include "server/storage/ingest/flush_waiters.hpp"
#include "server/storage/ingest/renewals.hpp"
#include "server/storage/ingest/robot_admission.hpp"
#include "server/storage/ingest/write_failure.hpp"

namespace server::storage {

class BootRegistry;
class CommitQueue;
struct BootEntry;

struct RecorderOptions {
  std::filesystem::path path;           // of the database
  config::LoopbackEnrolment enrolment;  // a new robot that connects from this machine is enrolled
  std::size_t max_queued_samples = 2'000'000;
  std::size_t max_queued_records = 100'000;   // events, commands, audit, clock estimates, texts in force
  std::uint64_t checkpoint_bytes = 64 << 20;  // of the write-ahead log, from which on it is moved into the database
  microseconds checkpoint_interval = std::chrono::seconds{10};  // after which a shorter one is moved, too
  RescuePlace rescue{};                                         // of a database whose files were taken away
  microseconds head_interval = std::chrono::seconds{2};         // between two looks whether the head has changed
};

// Since the start of the program.
struct RecorderCounters {
  std::uint64_t samples_written = 0;
  std::uint64_t samples_duplicate = 0;
  std::uint64_t samples_refused = 0;     // not queued because the queue was full; each is asked for again
  std::uint64_t samples_lost = 0;        // in stored gaps
  std::uint64_t samples_given_up = 0;    // of those: their robot did not come back
  std::uint64_t samples_returned = 0;    // that were given up, and that their robot held when it came back all the same
  std::uint64_t records_refused = 0;     // events and commands that the full queue did not take
  std::uint64_t events_asked_again = 0;  // requests
  std::uint64_t batches_malformed = 0;
  std::uint64_t commits = 0;
  std::uint64_t largest_commit_samples = 0;
  std::uint64_t commits_failed = 0;           // each was, or is being, tried again
  runtime::TimeHistogram commit_times;        // from the loop's request until it is durable; of those that succeeded
  runtime::DepthHistogram samples_at_commit;  // received and not durable when a commit begins

  void count_written(const WriteBatch& written) {
    std::uint64_t samples = 0;
    for (const Segment& segment : written.segments) samples += segment.samples.size();
    for (const LostRange& gap : written.gaps) {
      samples_lost += gap.lost.next - gap.lost.first;
      if (gap.cause == kGivenUp) samples_given_up += gap.lost.next - gap.lost.first;
    }
    ++commits;
    samples_written += samples;
    largest_commit_samples = samples > largest_commit_samples ? samples : largest_commit_samples;
  }
};

// Samples that nobody is to expect any more: those that are missing of these.
struct GiveUpOrder {
  struct Part {
    station::BootId boot_id = 0;
    Interval samples;
  };
  station::RobotId robot_id;
  std::vector<Part> parts;
  std::optional<std::uint64_t> samples;  // how many must be missing for them to be given up
  station::AuditNote note;               // its detail gets how many they are, and the range of each boot
};

// A boot that came back with samples that were given up.
struct ReturnedSamples {
  station::RobotId robot_id;
  station::BootId boot_id = 0;
  Interval range;             // from the first of them to the last
  std::uint64_t samples = 0;  // how many they are
};

class Recorder final : public station::StationSink, public station::RobotArchive {
 public:
  static constexpr std::size_t kMaxCommitSamples = storage::kMaxCommitSamples;

  using OnDurable = std::function<void(const station::RobotId&, station::BootId, std::uint64_t next_seq,
                                       std::uint64_t next_event_seq)>;
  using OnMissing =
      std::function<void(const station::RobotId&, station::BootId, std::uint64_t first_seq, std::uint64_t next_seq)>;
  using OnMissingEvents = std::function<void(const station::RobotId&, station::BootId)>;
  using OnReturned = std::function<void(const ReturnedSamples&)>;

  Recorder(boost::asio::io_context& loop, runtime::Clock& clock, runtime::WorkerThread& disk,
           runtime::WorkerThread& checkpoints, RecorderOptions options);
  ~Recorder() override;

  void set_on_durable(OnDurable on_durable) { on_durable_ = std::move(on_durable); }
  void set_on_missing(OnMissing on_missing) { on_missing_ = std::move(on_missing); }
  void set_on_missing_events(OnMissingEvents on_missing) { on_missing_events_ = std::move(on_missing); }
  void set_on_returned(OnReturned on_returned) { on_returned_ = std::move(on_returned); }

  // Opens or creates the database; before everything else. Throws when the file is not ours or cannot be written.
  boost::asio::awaitable<RestoredState> open();

  // Commits and asks for what is missing, until cancelled.
  boost::asio::awaitable<void> run();
  // Moves the write-ahead log into the database meanwhile, until cancelled.
  boost::asio::awaitable<void> run_checkpoints() { return checkpointer_.run(); }

  // Returns after a commit (Checkpointer::next_commit).
  boost::asio::awaitable<void> next_commit() { return checkpointer_.next_commit(); }

  // Return true when what they name, as far as it was received, is durable, and false after 3 s if it is not yet. Need
  // run(). Those of samples cut segments short; a caller that only reads samples uses waiting() instead.
  boost::asio::awaitable<bool> flush();  // everything: the segments of every robot are cut
  boost::asio::awaitable<bool> flush(
      station::BootId);                          // the samples and gaps of one boot; nothing is written if none wait
  boost::asio::awaitable<bool> flush_records();  // events, commands and boots
  boost::asio::awaitable<bool> flush_boots();    // boots and the spans that they moved; nothing is written if none wait

  // Stored with the next commit that has the boots which began before it, however often that fails. No sample that is
  // received after it is stored without it; some of before it may be stored later.
  void store(Change change);

  // After the loop has ended: writes and commits everything left, or logs what could not be written; then `last` has
  // the database to itself. Does not throw.
  void close(const std::function<void(Database&, std::int64_t utc_us)>& last = {});

  boost::asio::awaitable<station::Admission> admit(station::AdmissionRequest request) override;

  // A robot whose enrolment was revoked is refused from this call on, also one that is being admitted.
  void set_revoked(const station::RobotId& robot_id, bool revoked) { admission_.set_revoked(robot_id, revoked); }

  // What is missing of these samples is lost from now on, with the cause kGivenUp: one commit has the gaps and the
  // note. Returns how many those are; none leaves no note. What comes of them later is dropped. conflict when such a
  // boot is connected, since its robot sends them, and when another number is missing; unavailable when it is not
  // durable within 3 s.
  boost::asio::awaitable<Result<std::uint64_t>> give_up(GiveUpOrder order);

  void on_robot(const station::RobotState& robot) override;
  void on_fluid(const station::RobotState& robot) override;
  // Filled from checked telemetry: its numbers are not judged again. Dropped and counted when no such boot is recorded.
  void on_samples(const station::RobotState& robot, const station::SampleBatch& batch) override;
  void on_unusable_samples(const station::RobotState& robot, std::uint64_t first_seq, std::uint64_t next_seq) override;
  void on_unusable_event(const station::RobotState& robot, std::uint64_t event_seq) override;
  void on_event_left_out(const station::RobotState& robot, std::uint64_t event_seq) override;
  void on_event(const station::RobotState& robot, const station::RobotEvent& event) override;
  // Renewals of a lease in a row become one record: Renewals.
  void on_command(const station::CommandRecord& command) override;
  // Written with the next commit; what can flood is bounded by an AuditQuota.
  void on_audit(const station::AuditNote& note) override;
  void on_clock(const station::RobotState& robot, const station::ClockRecord& record) override;
  void on_in_force(const station::RobotState& robot, const station::InForceRecord& record) override;

  // Runs job(Database&) on the disk thread, between two commits.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job, Database&>> on_disk(Job job) {
    return database_.run(std::move(job));
  }

  // One above the newest sample that a boot is known to have made; 0 when the boot is not in use.
  std::uint64_t next_seq(station::BootId boot_id) const;

  // What was received of a boot and is not durable yet, ascending, in the form in which it will be read back: its
  // samples, cut to the range, and its gaps in it. Of the samples those of the first segments that have `limit`
  // together, since hours may wait. A reader takes both before it asks the database; what it then finds in both it
  // takes from there. Nothing is missing so, since what was durable before is in every later read transaction.
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  std::vector<Segment> waiting(station::BootId boot_id, Interval samples, std::size_t limit = kAll) const;
  std::vector<LostRange> waiting_gaps(station::BootId boot_id, Interval samples) const;

  // Whether the database may be opened by its name now; any thread.
  const std::function<bool()>& names_hold() const { return checkpointer_.names_hold(); }

  boost::asio::io_context& loop() { return loop_; }
  const std::filesystem::path& path() const { return options_.path; }
  const RecorderCounters& counters() const { return counters_; }
  std::size_t queued_samples() const;
  // The last commit failed: nothing becomes durable now.
  bool failing() const { return failure_.is_failing(); }
  // For how long a commit has been tried, or waited for; 0 while there is none.
  microseconds not_recording_for() const;
  // The disk fails, or commits are late, or the write-ahead log is large: what can wait makes room for commits.
  bool is_behind() const { return failing() || queued_samples() > 500'000 || wal().bytes > 96'000'000; }
  std::size_t flushes() const { return flushes_.size(); }  // who waits for a commit
  const WalState& wal() const { return checkpointer_.state(); }
  const std::string& problem() const { return failure_.problem(); }  // while it is failing: why, and what to do

 private:
  boost::asio::awaitable<std::vector<AdmissionOutcome>> ask_database(std::vector<AdmissionQuestion> questions);
  station::Admission admit_boot(BootEntry& boot, AdmissionOutcome outcome, const station::AdmissionRequest& request);
  void start(BootEntry& boot);
  void watch(BootEntry& boot);
  void note_refused(std::size_t samples);
  bool room_for_record();
  void record_interruption(const station::RobotEvent& event);
  void enqueue(const Renewals::Records& commands);
  std::int64_t key_of(station::BootId boot_id) const;
  void record_left_out(bool at_once);

  boost::asio::awaitable<void> wait_for_commit();
  void build_commit();
  boost::asio::awaitable<void> write();
  boost::asio::awaitable<void> report_durable(std::vector<BootProgress> progress);
  boost::asio::awaitable<void> finish_checkpoint();
  boost::asio::awaitable<void> ask_for_missing();
  boost::asio::awaitable<bool> load(BootEntry& boot, station::RobotId robot_id);
  void note_returned(const BootEntry& boot);
  void report_returned();
  boost::asio::awaitable<bool> flush_until(std::uint64_t position);
  std::string write_rest();
  void wake();

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  RecorderOptions options_;
  OnDurable on_durable_;
  OnMissing on_missing_;
  OnMissingEvents on_missing_events_;
  OnReturned on_returned_;

  Checkpointer checkpointer_;
  DatabaseWorker database_;
  RobotAdmission admission_;
  std::unique_ptr<BootRegistry> boots_;  // these two are pointers so that who includes this does not include them
  std::unique_ptr<CommitQueue> queue_;
  FlushWaiters flushes_;
  AuditQuota quota_;
  Renewals renewals_;
  WriteFailure failure_;

  RecorderCounters counters_;
  std::vector<ReturnedSamples> returned_;  // not reported yet
  std::int64_t last_commit_us_ = 0;        // steady
  std::int64_t committing_since_us_ = 0;   // steady; 0: no commit is under way
  std::int64_t overflow_logged_us_ = 0;    // steady
  bool idle_ = false;                      // run() waits for work_
  runtime::Signal work_{loop_};            // something to record, or a robot to watch
};

}  // namespace server::storage
