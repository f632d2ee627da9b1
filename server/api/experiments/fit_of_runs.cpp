#include "server/api/experiments/fit_of_runs.hpp"

#include <fmt/format.h>

#include "server/analysis/identify_job.hpp"
#include "server/api/bodies/job_body.hpp"
#include "server/experiments/runner/experiments.hpp"
#include "server/storage/jobs/jobs.hpp"

namespace server::api {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using experiments::FitRequest;
using experiments::FittedModel;
using nlohmann::json;

namespace {

constexpr double kSearchFor_s = 300;  // at most; some seconds are usual
constexpr microseconds kLook = 200ms, kFitWithin = 15min;

asio::awaitable<Result<storage::Job>> await_job(FitParts parts, storage::JobId id, FitRequest request,
                                                std::int64_t ends_us) {
  for (;;) {
    const auto job = co_await parts.jobs.wait_for(id, kLook);
    if (!job || has_ended(job->state)) co_return job;
    const bool is_wanted = request.is_wanted() && parts.clock.steady_us() < ends_us;
    if (!is_wanted) static_cast<void>(co_await parts.jobs.cancel(id));
  }
}

// Where others have filled the queue of jobs, it is asked again.
asio::awaitable<Result<storage::Job>> begin_job(FitParts parts, storage::JobRequest wanted, storage::JobWork work,
                                                FitRequest request, std::int64_t ends_us) {
  for (;;) {
    auto copy = wanted;
    copy.owner = request.actor();
    auto begun = co_await parts.jobs.begin(std::move(copy), work);
    const bool may_wait = request.is_wanted() && parts.clock.steady_us() < ends_us;
    if (begun || !may_wait) co_return begun;
    co_await parts.clock.sleep_for(1s);
  }
}

asio::awaitable<Result<FittedModel>> fit(FitParts parts, FitRequest request) {
  auto body = parse_job(fit_body(request));
  if (!body) co_return std::unexpected{body.error()};
  auto identify = std::get<analysis::IdentifyRequest>(std::move(body->request));
  auto work = [&analysis = parts.analysis, identify = std::move(identify)](storage::JobRun& job) {
    return analysis::identify_job(analysis, identify, std::nullopt, job);
  };
  const storage::JobRequest wanted{body->kind, body->document, {}};
  const std::int64_t ends_us = parts.clock.steady_us() + kFitWithin.count();
  Result<storage::Job> ended = std::unexpected{Error{}};
  for (bool is_of_another = true; is_of_another;) {
    const auto begun = co_await begin_job(parts, wanted, work, request, ends_us);
    if (!begun) co_return std::unexpected{begun.error()};
    ended = co_await await_job(parts, begun->id, request, ends_us);
    if (!ended) co_return std::unexpected{ended.error()};
    // The experiment has come into other hands, and the right of who had it before has ended.
    is_of_another =
        ended->state == storage::JobState::cancelled && request.is_wanted() && ended->request.owner != request.actor();
  }
  if (ended->state != storage::JobState::done) {
    const std::string why = ended->error.empty() ? text(ended->state) : ended->error;
    co_return fail(ErrorCode::conflict, fmt::format("the fit, job {}: {}", ended->id, why), "fit_failed");
  }
  const auto result = co_await parts.jobs.result(ended->id);
  co_return experiments::fitted_model_from(ended->id, json::parse(result.value_or(""), nullptr, false));
}

}  // namespace

// The robot's own record, since a position from outside comes after the experiment.
std::string fit_body(const FitRequest& request) {
  json body = {{"kind", "identify"}, {"channels", "robot"}, {"cut_at_gaps", true}, {"time_limit_s", kSearchFor_s}};
  if (request.is_fractional) body["structure"] = "fractional";
  if (request.runs.size() == 1) {
    body["run_id"] = request.runs.front();
  } else {
    for (const storage::RunId run : request.runs) body["runs"].push_back({{"run_id", run}});
  }
  return body.dump();
}

void connect_fits(experiments::Experiments& experiments, FitParts parts) {
  experiments.set_fit_of_runs([parts](FitRequest request) { return fit(parts, std::move(request)); });
}

}  // namespace server::api
