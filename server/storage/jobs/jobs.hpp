// Jobs: computations that somebody asks the station for, one at a time, on a thread of their own.
//
//   begin() → waiting → running → done, failed or cancelled      each state is a row on disk before it is shown
//
// A station that stops, or is killed, leaves those that had not ended `interrupted`; their requests are kept, and
// nothing begins again by itself. A result is stored with the state `done`, in one statement, so none is half written.
// At most kMaxWaitingJobs wait. Loop thread; SQL on the disk thread and the readers'. Loop, clock, recorder and reader
// outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <deque>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/ended_right.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/jobs/job_run.hpp"
#include "server/storage/jobs/job_store.hpp"

namespace server::storage {

inline constexpr std::size_t kMaxWaitingJobs = 20;
inline constexpr std::size_t kMaxResultBytes = 8'000'000;

// What a job does: its result as JSON. An error of it, or an exception, is how the job failed.
using JobWork = std::function<boost::asio::awaitable<Result<std::string>>(JobRun& run)>;

class Jobs {
 public:
  Jobs(boost::asio::io_context& loop, runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader)
      : loop_{loop}, clock_{clock}, recorder_{recorder}, reader_{reader} {}

  // Those of an earlier start of the station that had not ended are interrupted; before everything else.
  boost::asio::awaitable<void> load();

  // Runs them until cancelled.
  boost::asio::awaitable<void> run();

  // unavailable: too many wait, or the disk cannot be written.
  boost::asio::awaitable<Result<Job>> begin(JobRequest request, JobWork work);

  // One that waits has ended with this call; a running one ends soon. conflict: it had ended. not_found.
  boost::asio::awaitable<Result<Job>> cancel(JobId id);

  // Those that an actor began who may begin none any more are cancelled; results are kept.
  void end_right(const runtime::EndedRight& right);
  std::set<std::string> acting() const;  // whose jobs wait or run

  boost::asio::awaitable<Result<Job>> find(JobId id);
  boost::asio::awaitable<std::optional<std::string>> result(JobId id);  // none: it has none
  boost::asio::awaitable<std::vector<Job>> list(JobId before, std::size_t limit);

  // As find(), when the job has ended, or so much later.
  boost::asio::awaitable<Result<Job>> wait_for(JobId id, microseconds patience);

  // For the virtual time of tests.
  const runtime::WorkerThread& worker() const { return worker_; }

 private:
  struct Waiting {
    JobId id = 0;
    std::string owner;
    JobWork work;
  };

  boost::asio::awaitable<void> run_each();
  boost::asio::awaitable<void> run_one(Waiting job);
  boost::asio::awaitable<JobEnd> end_of(const JobWork& work, JobRun& run);
  boost::asio::awaitable<void> store(std::function<void(SQLite::Database&)> change);
  boost::asio::awaitable<void> cancel_at_the_end();
  boost::asio::awaitable<void> store_taken_out();
  boost::asio::awaitable<void> store_cancelled(JobId id);
  void take_out(JobId id);
  void add_progress(Job& job) const;

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
  std::deque<Waiting> waiting_;
  runtime::RequestsOnTheirWay being_added_;
  std::deque<JobId> taken_out_;      // of those that waited: they are cancelled, and the disk does not know it yet
  JobId running_id_ = 0;             // 0: none
  std::unique_ptr<JobRun> running_;  // null: none
  std::string running_owner_;
  runtime::Signal wanted_{loop_};  // something waits
  runtime::Signal ended_{loop_};
  runtime::Signal to_store_{loop_};  // something is in taken_out_
  runtime::WorkerThread worker_{"jobs", 10};
};

}  // namespace server::storage
