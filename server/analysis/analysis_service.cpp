// Gathers what the mathematics needs.
#include "server/analysis/analysis_service.hpp"

#include <fmt/format.h>

namespace server {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kPage = 5000;

}  // namespace

asio::awaitable<Result<std::vector<StepPoint>>> AnalysisService::points(RunId run) {
  std::vector<StepPoint> points;
  std::optional<SampleCursor> after;
  do {
    const auto page = co_await history_.samples(run, after, kPage);
    if (!page) co_return std::unexpected{page.error()};
    if (points.size() + page->samples.size() > kMaxAnalysedSamples) {
      co_return fail(ErrorCode::invalid, fmt::format("the run has more than {} samples", kMaxAnalysedSamples),
                     "run_too_long");
    }
    for (const StoredSample& sample : page->samples) points.push_back(step_point(sample));
    after = page->next;
  } while (after);
  co_return points;
}

asio::awaitable<Result<std::vector<MeasuredStep>>> AnalysisService::steps(RunId run) {
  auto gathered = co_await points(run);
  if (!gathered) co_return std::unexpected{gathered.error()};
  auto job = [points = std::move(*gathered)] { return measure_steps(points); };
  co_return co_await maths_.run(std::move(job));
}

}  // namespace server
