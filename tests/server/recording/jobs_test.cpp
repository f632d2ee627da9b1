// Jobs on a real database: one at a time, bounded, cancelled, and what a restart leaves of them.
#include "server/storage/jobs/jobs.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using storage::Job;
using storage::JobRun;
using storage::JobState;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

asio::awaitable<Result<std::string>> answers(std::string result) { co_return result; }
asio::awaitable<Result<std::string>> refuses() {
  co_return fail(ErrorCode::invalid, "the run has 3 samples; at least 20 are needed");
}
asio::awaitable<Result<std::string>> throws() {
  throw std::invalid_argument{"duty is 0 throughout"};
  co_return std::string{};
}

// Computes until it is told to end, or let go.
struct LongWork {
  std::atomic<bool> may_end = false, has_begun = false;

  static asio::awaitable<Result<std::string>> make(std::shared_ptr<LongWork> self, JobRun& run) {
    auto compute = [self, &run]() -> Result<std::string> {
      run.report(0.5, "half way");
      self->has_begun = true;
      while (!self->may_end && !run.is_cancelled()) std::this_thread::yield();
      return "\"long\"";
    };
    co_return co_await run.compute(std::move(compute));
  }
};

class JobsTest : public RecordingTest {
 protected:
  ~JobsTest() override { end_computing(); }

  storage::Jobs& jobs() { return recording_->jobs; }

  Result<Job> begin(storage::JobWork work) { return wait(jobs().begin({"test", R"({"n":1})", "token:local"}, work)); }
  Job begin_answer(const std::string& result) {
    return begin([result](JobRun&) { return answers(result); }).value();
  }
  // From here on time does not wait for the thread of the jobs.
  Job begin_long() {
    clock_.remove_worker(jobs().worker());
    long_work_ = std::make_shared<LongWork>();
    const Job job = begin([work = long_work_](JobRun& run) { return LongWork::make(work, run); }).value();
    until([this] { return long_work_->has_begun.load(); });
    return job;
  }
  void end_computing() {
    if (!long_work_) return;
    long_work_->may_end = true;
    if (recording_) clock_.add_worker(jobs().worker());
    clock_.settle();
    long_work_.reset();
  }
  void until(const std::function<bool()>& done) {
    const auto deadline = std::chrono::steady_clock::now() + 60s;
    while (!done()) {
      ASSERT_LT(std::chrono::steady_clock::now(), deadline);
      clock_.settle();
      std::this_thread::yield();
    }
  }
  Job ended(storage::JobId id) {
    Job job = wait(jobs().wait_for(id, 50s)).value();
    EXPECT_TRUE(has_ended(job.state)) << text(job.state);
    return job;
  }
  std::vector<std::string> states() { return rows("SELECT job_id, state, result FROM job ORDER BY job_id"); }

 private:
  std::shared_ptr<LongWork> long_work_;
};

TEST_F(JobsTest, KeepsWhatWasAskedAndItsResultOverARestart) {
  start();
  const Job begun = begin_answer(R"({"kp":0.1})");
  EXPECT_EQ(begun.state, JobState::waiting);
  EXPECT_EQ(ended(begun.id).state, JobState::done);
  stop();
  start();
  const Job job = wait(jobs().find(begun.id)).value();
  EXPECT_EQ(job.state, JobState::done);
  EXPECT_EQ(job.request.kind, "test");
  EXPECT_EQ(job.request.document, R"({"n":1})");
  EXPECT_EQ(job.request.owner, "token:local");
  EXPECT_GE(job.started_at_us.value(), job.created_at_us);
  EXPECT_GE(job.ended_at_us.value(), job.started_at_us.value());
  EXPECT_EQ(wait(jobs().result(begun.id)).value(), R"({"kp":0.1})");
  EXPECT_EQ(wait(jobs().find(begun.id + 1)).error().reason, "no_such_job");
}

TEST_F(JobsTest, SaysWhyOneFailed) {
  start();
  const Job refused = begin([](JobRun&) { return refuses(); }).value();
  EXPECT_EQ(ended(refused.id).error, "the run has 3 samples; at least 20 are needed");
  const Job thrown = begin([](JobRun&) { return throws(); }).value();
  EXPECT_EQ(ended(thrown.id).state, JobState::failed);
  EXPECT_EQ(ended(thrown.id).error, "duty is 0 throughout");
  const Job too_long = begin_answer(std::string(storage::kMaxResultBytes + 1, ' '));
  EXPECT_THAT(ended(too_long.id).error, HasSubstr("at most 8000000 are kept"));
  EXPECT_EQ(wait(jobs().result(too_long.id)), std::nullopt);
  EXPECT_EQ(ended(begin_answer("1").id).state, JobState::done) << "the next one is computed";
}

TEST_F(JobsTest, AreComputedOneAtATimeInTheirOrder) {
  start();
  const Job first = begin_long();
  const Job second = begin_answer("2"), third = begin_answer("3");
  EXPECT_EQ(wait(jobs().find(first.id))->state, JobState::running);
  EXPECT_EQ(wait(jobs().find(first.id))->progress->share, 0.5);
  EXPECT_EQ(wait(jobs().find(first.id))->progress->stage, "half way");
  EXPECT_EQ(wait(jobs().find(second.id))->state, JobState::waiting);
  EXPECT_FALSE(wait(jobs().find(second.id))->progress);
  EXPECT_EQ(wait(jobs().wait_for(second.id, 2s))->state, JobState::waiting) << "the patience is at its end";
  end_computing();
  EXPECT_LE(ended(second.id).ended_at_us.value(), ended(third.id).started_at_us.value());
  EXPECT_THAT(states(), ElementsAre("1|done|\"long\"", "2|done|2", "3|done|3"));
  const auto newest = wait(jobs().list(0, 2));
  ASSERT_EQ(newest.size(), 2U);
  EXPECT_EQ(newest[0].id, third.id);
  EXPECT_EQ(wait(jobs().list(newest[1].id, 100)).front().id, first.id);
}

TEST_F(JobsTest, EndsARunningOneAtItsNextLookAndAWaitingOneAtOnce) {
  start();
  const Job running = begin_long(), waiting = begin_answer("2");
  EXPECT_EQ(wait(jobs().cancel(waiting.id))->state, JobState::cancelled);
  EXPECT_TRUE(wait(jobs().cancel(running.id)));
  until([&] { return has_ended(wait(jobs().find(running.id))->state); });
  EXPECT_THAT(states(), ElementsAre("1|cancelled|", "2|cancelled|")) << "and no result, though it made one";
  const auto again = wait(jobs().cancel(running.id));
  EXPECT_EQ(again.error().code, ErrorCode::conflict);
  EXPECT_EQ(again.error().reason, "has_ended");
  EXPECT_EQ(wait(jobs().cancel(99)).error().code, ErrorCode::not_found);
}

TEST_F(JobsTest, WhatHadNotEndedIsInterruptedByAStopAndNothingBeginsAgain) {
  start();
  ASSERT_EQ(ended(begin_answer("1").id).state, JobState::done);
  begin_long();
  begin_answer("3");
  clock_.add_worker(jobs().worker());
  stop();  // while it is computed: the stop does not wait for its end
  start();
  EXPECT_THAT(states(), ElementsAre("1|done|1", "2|interrupted|", "3|interrupted|"));
  clock_.run_for(10s);
  EXPECT_THAT(states(), ElementsAre("1|done|1", "2|interrupted|", "3|interrupted|"));
  EXPECT_TRUE(wait(jobs().find(2))->ended_at_us);
}

TEST_F(JobsTest, RefusesMoreThanMayWait) {
  start();
  begin_long();
  for (std::size_t i = 0; i < storage::kMaxWaitingJobs; ++i) begin_answer("0");
  const auto refused = begin([](JobRun&) { return answers("0"); });
  EXPECT_EQ(refused.error().code, ErrorCode::unavailable);
  EXPECT_EQ(refused.error().reason, "too_many_jobs");
  end_computing();
  clock_.run_for(1s);
  EXPECT_EQ(number("SELECT count(*) FROM job WHERE state = 'done'"),
            1 + static_cast<std::int64_t>(storage::kMaxWaitingJobs));
  EXPECT_EQ(ended(begin_answer("1").id).state, JobState::done);
}

TEST_F(JobsTest, KeepsTheNewestOfThoseThatHaveEnded) {
  start();
  auto fill = [](storage::Database& database) {
    for (std::int64_t i = 0; i < storage::kMaxKeptJobs + 5; ++i) {
      const storage::JobId id = storage::add_job(database.handle(), {"test", "{}", "token:local"}, i);
      storage::end_job(database.handle(), id, {JobState::done, "1", {}}, i);
    }
    return true;
  };
  wait(recorder_->on_disk(std::move(fill)));
  const Job newest = begin_answer("1");
  EXPECT_EQ(number("SELECT count(*) FROM job"), storage::kMaxKeptJobs + 1);
  EXPECT_EQ(number("SELECT min(job_id) FROM job"), newest.id - storage::kMaxKeptJobs);
}

}  // namespace
}  // namespace server
