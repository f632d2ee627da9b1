// A running job, as its work sees it: where it reports its progress, and learns that it is to end.
//
// report() and is_cancelled() may be called from any thread, the rest on the loop's.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <memory>
#include <stop_token>
#include <utility>

#include "server/runtime/worker.hpp"
#include "server/storage/jobs/job.hpp"

namespace server::storage {

class JobRun {
 public:
  JobRun(JobId id, boost::asio::io_context& loop, runtime::WorkerThread& worker)
      : id_{id}, loop_{loop}, worker_{worker} {}

  JobId id() const { return id_; }

  void report(double share, std::string stage);
  const JobProgress& progress() const { return *progress_; }

  void cancel() { stop_.request_stop(); }
  bool is_cancelled() const { return stop_.stop_requested(); }

  // Runs job() on the thread of the jobs. A long one looks at is_cancelled() at least ten times a second.
  template <class Work>
  boost::asio::awaitable<std::invoke_result_t<Work>> compute(Work work) {
    co_return co_await worker_.run(std::move(work));
  }

 private:
  JobId id_;
  boost::asio::io_context& loop_;
  runtime::WorkerThread& worker_;
  std::stop_source stop_;
  std::shared_ptr<JobProgress> progress_ = std::make_shared<JobProgress>();  // shared with reports on their way
};

}  // namespace server::storage
