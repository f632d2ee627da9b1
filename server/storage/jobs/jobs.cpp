// Begin, run, store, cancel.
#include "server/storage/jobs/jobs.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>

#include "server/runtime/exceptions.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only
using namespace std::chrono_literals;

namespace {

constexpr microseconds kAgainAfter = 1s;  // when the disk could not be written

std::unexpected<Error> no_such_job(JobId id) {
  return fail(ErrorCode::not_found, fmt::format("there is no job {}", id), "no_such_job");
}

}  // namespace

asio::awaitable<void> Jobs::load() {
  auto job = [utc_us = clock_.utc_us()](Database& database) { return interrupt_jobs(database.handle(), utc_us); };
  const int interrupted = co_await recorder_.on_disk(std::move(job));
  if (interrupted > 0) spdlog::info("{} jobs were interrupted by the end of the station", interrupted);
}

asio::awaitable<Result<Job>> Jobs::begin(JobRequest request, JobWork work) {
  if (waiting_.size() + being_added_.size() >= kMaxWaitingJobs) {
    co_return fail(ErrorCode::unavailable,
                   fmt::format("{} jobs wait already; try again when one has ended, or cancel one", kMaxWaitingJobs),
                   "too_many_jobs");
  }
  Job job;
  job.request = std::move(request);
  job.created_at_us = clock_.utc_us();
  auto add = [&job](Database& database) -> std::string {
    try {
      job.id = add_job(database.handle(), job.request, job.created_at_us);
      return {};
    } catch (const SQLite::Exception& error) {
      return runtime::text_of(error);
    }
  };
  const runtime::RequestsOnTheirWay::Request one_more{being_added_, job.request.owner};
  const std::string problem = co_await recorder_.on_disk(std::move(add));
  if (!problem.empty()) {
    co_return fail(ErrorCode::unavailable, fmt::format("the job could not be stored: {}; try again", problem),
                   "not_stored");
  }
  if (!one_more.ended().empty()) {
    take_out(job.id);
    co_return fail(ErrorCode::forbidden, one_more.ended(), "not_permitted");
  }
  waiting_.push_back({job.id, job.request.owner, std::move(work)});
  wanted_.notify();
  co_return job;
}

asio::awaitable<void> Jobs::run() { co_await (run_each() || store_taken_out() || cancel_at_the_end()); }

asio::awaitable<void> Jobs::run_each() {
  for (;;) {
    while (waiting_.empty()) co_await wanted_.wait();
    Waiting next = std::move(waiting_.front());
    waiting_.pop_front();
    co_await run_one(std::move(next));
  }
}

// The wait for the thread of the jobs cannot be cancelled, so the job is ended first.
asio::awaitable<void> Jobs::cancel_at_the_end() {
  struct Cancel {
    Jobs& jobs;
    ~Cancel() {
      if (jobs.running_) jobs.running_->cancel();
    }
  };
  const Cancel at_the_end{*this};
  runtime::Signal never{loop_};
  co_await never.wait();
}

asio::awaitable<void> Jobs::run_one(Waiting job) {
  struct Running {
    Jobs& jobs;
    ~Running() {
      jobs.running_.reset();
      jobs.running_id_ = 0;
      jobs.ended_.notify();
    }
  };
  running_ = std::make_unique<JobRun>(job.id, loop_, worker_);
  running_id_ = job.id;
  running_owner_ = job.owner;
  const Running running{*this};
  auto start = [id = job.id, utc_us = clock_.utc_us()](SQLite::Database& database) { start_job(database, id, utc_us); };
  co_await store(std::move(start));
  JobEnd end = co_await end_of(job.work, *running_);
  if (end.result.size() > kMaxResultBytes) {
    end = {JobState::failed,
           {},
           fmt::format("its result has {} bytes, at most {} are kept", end.result.size(), kMaxResultBytes)};
  }
  auto finish = [id = job.id, end = std::move(end), utc_us = clock_.utc_us()](SQLite::Database& database) {
    end_job(database, id, end, utc_us);
  };
  co_await store(std::move(finish));
}

asio::awaitable<JobEnd> Jobs::end_of(const JobWork& work, JobRun& run) {
  std::string error;
  try {
    if (!run.is_cancelled()) {
      Result<std::string> made = co_await work(run);
      if (made && !run.is_cancelled()) co_return JobEnd{JobState::done, std::move(*made), {}};
      if (!made) error = made.error().detail;
    }
  } catch (const boost::system::system_error&) {
    throw;  // the station stops
  } catch (const std::exception& exception) {
    error = runtime::text_of(exception);
  }
  if (run.is_cancelled()) co_return JobEnd{JobState::cancelled, {}, {}};
  co_return JobEnd{JobState::failed, {}, std::move(error)};
}

// Until it is on disk: a job whose end nobody knows would be shown as running for ever.
asio::awaitable<void> Jobs::store(std::function<void(SQLite::Database&)> change) {
  for (;;) {
    auto job = [change](Database& database) -> std::string {
      try {
        change(database.handle());
        return {};
      } catch (const SQLite::Exception& error) {
        return runtime::text_of(error);
      }
    };
    const std::string problem = co_await recorder_.on_disk(std::move(job));
    if (problem.empty()) co_return;
    spdlog::error("the state of job {} cannot be stored: {}; it is tried again", running_id_, problem);
    co_await clock_.sleep_for(kAgainAfter);
  }
}

asio::awaitable<Result<Job>> Jobs::cancel(JobId id) {
  if (id == running_id_ && running_) {
    running_->cancel();
    co_return co_await find(id);
  }
  const auto at = std::ranges::find(waiting_, id, &Waiting::id);
  if (at == waiting_.end()) {
    const auto known = co_await find(id);
    if (!known) co_return known;
    co_return fail(ErrorCode::conflict, fmt::format("job {} has ended: {}", id, text(known->state)), "has_ended");
  }
  waiting_.erase(at);
  co_await store_cancelled(id);
  co_return co_await find(id);
}

asio::awaitable<void> Jobs::store_cancelled(JobId id) {
  auto finish = [id, utc_us = clock_.utc_us()](SQLite::Database& database) {
    end_job(database, id, {JobState::cancelled, {}, {}}, utc_us);
  };
  co_await store(std::move(finish));
  ended_.notify();
}

void Jobs::end_right(const runtime::EndedRight& right) {
  being_added_.end(right);
  if (running_ && right.is_of(running_owner_)) running_->cancel();
  for (const Waiting& job : waiting_) {
    if (right.is_of(job.owner)) take_out(job.id);
  }
  std::erase_if(waiting_, [&right](const Waiting& job) { return right.is_of(job.owner); });
}

std::set<std::string> Jobs::acting() const {
  std::set<std::string> owners;
  if (running_ && !running_->is_cancelled()) owners.insert(running_owner_);
  for (const Waiting& job : waiting_) owners.insert(job.owner);
  return owners;
}

void Jobs::take_out(JobId id) {
  taken_out_.push_back(id);
  to_store_.notify();
}

asio::awaitable<void> Jobs::store_taken_out() {
  for (;;) {
    while (taken_out_.empty()) co_await to_store_.wait();
    co_await store_cancelled(taken_out_.front());
    taken_out_.pop_front();
  }
}

void Jobs::add_progress(Job& job) const {
  if (job.id != running_id_ || !running_ || job.state != JobState::running) return;
  job.progress = running_->progress();
  job.is_being_cancelled = running_->is_cancelled();
}

asio::awaitable<Result<Job>> Jobs::find(JobId id) {
  auto query = [id](SQLite::Database& database) { return find_job(database, id); };
  auto found = co_await reader_.ask(std::move(query));
  if (!found) co_return no_such_job(id);
  add_progress(*found);
  co_return std::move(*found);
}

asio::awaitable<std::optional<std::string>> Jobs::result(JobId id) {
  auto query = [id](SQLite::Database& database) { return job_result(database, id); };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<std::vector<Job>> Jobs::list(JobId before, std::size_t limit) {
  auto query = [before, limit](SQLite::Database& database) { return list_jobs(database, before, limit); };
  auto jobs = co_await reader_.ask(std::move(query));
  for (Job& job : jobs) add_progress(job);
  co_return jobs;
}

asio::awaitable<Result<Job>> Jobs::wait_for(JobId id, microseconds patience) {
  const std::int64_t deadline_us = clock_.steady_us() + patience.count();
  for (;;) {
    auto found = co_await find(id);
    if (!found || has_ended(found->state) || clock_.steady_us() >= deadline_us) co_return found;
    co_await ended_.wait_until(clock_, deadline_us);
  }
}

}  // namespace server::storage
