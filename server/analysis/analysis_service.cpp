// Gathers what the mathematics needs.
#include "server/analysis/analysis_service.hpp"

#include <fmt/format.h>

#include "server/storage/runs/run_queries.hpp"

namespace server::analysis {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kPage = 5000;
constexpr std::size_t kPositionsPage = 10'000;

}  // namespace

template <class Point>
asio::awaitable<Result<std::vector<Point>>> AnalysisService::gather(storage::RunId run,
                                                                    Point (*of)(const storage::StoredSample&),
                                                                    std::size_t limit) {
  std::vector<Point> points;
  std::optional<storage::SampleCursor> after;
  do {
    const auto page = co_await history_.samples(run, after, kPage);
    if (!page) co_return std::unexpected{page.error()};
    if (points.size() + page->samples.size() > limit) {
      co_return fail(ErrorCode::invalid,
                     fmt::format("run {} has more than {} samples; make a run of a part of it", run, limit),
                     "run_too_long");
    }
    for (const storage::StoredSample& sample : page->samples) points.push_back(of(sample));
    after = page->next;
  } while (after);
  co_return points;
}

asio::awaitable<Result<std::optional<storage::StoredReference>>> AnalysisService::reference_of(storage::RunId run) {
  auto find = [run](SQLite::Database& database) { return storage::find_reference(database, run); };
  auto found = co_await history_.reader().ask(std::move(find));
  if (!found) co_return std::optional<storage::StoredReference>{};
  storage::StoredReference stored{std::move(*found), {}};
  storage::OutsidePositions& all = stored.positions;
  for (std::size_t read = kPositionsPage; read == kPositionsPage;) {
    const auto after_us = all.size() == 0 ? std::nullopt : std::optional{all.robot_time_us.back()};
    auto ask = [id = stored.reference.id, after_us](SQLite::Database& database) {
      return storage::read_positions(database, id, after_us, kPositionsPage);
    };
    const storage::OutsidePositions page = co_await history_.reader().ask(std::move(ask));
    read = page.size();
    all.robot_time_us.insert(all.robot_time_us.end(), page.robot_time_us.begin(), page.robot_time_us.end());
    all.position_m.insert(all.position_m.end(), page.position_m.begin(), page.position_m.end());
    all.position_sd_m.insert(all.position_sd_m.end(), page.position_sd_m.begin(), page.position_sd_m.end());
  }
  if (all.size() != stored.reference.samples) co_return std::unexpected{storage::changed_while_read(run)};
  co_return stored;
}

asio::awaitable<Result<RunMeasures>> AnalysisService::measures(storage::RunId run) {
  auto gathered = co_await gather(run, step_point);
  if (!gathered) co_return std::unexpected{gathered.error()};
  auto found = co_await reference_of(run);
  if (!found) co_return std::unexpected{found.error()};
  auto job = [points = std::move(*gathered), reference = std::move(*found)] { return measures_of(points, reference); };
  co_return co_await maths_.run(std::move(job));
}

asio::awaitable<Result<RunMetrics>> AnalysisService::metrics(storage::Run run) {
  auto gathered = co_await gather(run.id, run_point);
  if (!gathered) co_return std::unexpected{gathered.error()};
  auto found = co_await reference_of(run.id);
  if (!found) co_return std::unexpected{found.error()};
  auto job = [points = std::move(*gathered), reference = std::move(*found), run = std::move(run)] {
    std::vector<StepPoint> steps;
    steps.reserve(points.size());
    for (const RunPoint& point : points) steps.push_back(point.step);
    return RunMetrics{run_figures(points, run), measures_of(steps, reference)};
  };
  co_return co_await maths_.run(std::move(job));
}

asio::awaitable<Result<RunTrace>> AnalysisService::trace(storage::RunId run, std::size_t limit) {
  auto gathered = co_await gather(run, trace_point, limit);
  if (!gathered) co_return std::unexpected{gathered.error()};
  auto found = co_await reference_of(run);
  if (!found) co_return std::unexpected{found.error()};
  co_return RunTrace{std::move(*gathered), std::move(*found)};
}

asio::awaitable<Result<std::optional<storage::OutsideReference>>> AnalysisService::reference(storage::RunId run) {
  auto find = [run](SQLite::Database& database) { return storage::find_reference(database, run); };
  co_return co_await history_.reader().ask(std::move(find));
}

asio::awaitable<Result<RunSamples>> AnalysisService::samples(storage::RunId run, std::size_t limit) {
  constexpr auto kWhole = [](const storage::StoredSample& stored) { return stored; };
  auto gathered = co_await gather<storage::StoredSample>(run, kWhole, limit);
  if (!gathered) co_return std::unexpected{gathered.error()};
  auto found = co_await reference_of(run);
  if (!found) co_return std::unexpected{found.error()};
  auto interrupted = co_await interrupted_parts(run);
  if (!interrupted) co_return std::unexpected{interrupted.error()};
  co_return RunSamples{std::move(*gathered), std::move(*found), std::move(*interrupted)};
}

asio::awaitable<Result<std::vector<storage::InterruptedPart>>> AnalysisService::interrupted_parts(storage::RunId run) {
  const bool is_stored = co_await history_.settle();
  if (!is_stored) {
    co_return fail(ErrorCode::unavailable,
                   fmt::format("what happened in run {} is not stored yet: the disk does not take it; ask again", run));
  }
  auto find = [run](SQLite::Database& database) { return storage::read_interrupted_parts(database, run); };
  co_return co_await history_.reader().ask(std::move(find));
}

asio::awaitable<Result<PlacedReference>> AnalysisService::place(storage::RunId run, ReferenceRequest request,
                                                                std::optional<storage::MarkerPlace> marker) {
  auto gathered = co_await gather(run, own_position);
  if (!gathered) co_return std::unexpected{gathered.error()};
  auto find = [run](SQLite::Database& database) { return storage::find_zeroings(database, run); };
  auto zeroings = co_await history_.reader().ask(std::move(find));
  auto job = [own = std::move(*gathered), zeroings = std::move(zeroings), request = std::move(request), marker] {
    return place_reference(request, own, zeroings, marker);
  };
  co_return co_await maths_.run(std::move(job));
}

}  // namespace server::analysis
