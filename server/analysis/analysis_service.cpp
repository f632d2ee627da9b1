// Gathers what the mathematics needs.
#include "server/analysis/analysis_service.hpp"

#include <fmt/format.h>

namespace server::analysis {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kPage = 5000;
constexpr std::size_t kPositionsPage = 10'000;

}  // namespace

template <class Point>
asio::awaitable<Result<std::vector<Point>>> AnalysisService::gather(storage::RunId run,
                                                                    Point (*of)(const storage::StoredSample&)) {
  std::vector<Point> points;
  std::optional<storage::SampleCursor> after;
  do {
    const auto page = co_await history_.samples(run, after, kPage);
    if (!page) co_return std::unexpected{page.error()};
    if (points.size() + page->samples.size() > kMaxAnalysedSamples) {
      co_return fail(ErrorCode::invalid, fmt::format("the run has more than {} samples", kMaxAnalysedSamples),
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
  auto job = [points = std::move(*gathered), reference = std::move(*found)] {
    RunMeasures measures;
    measures.steps = measure_steps(points, reference ? &*reference : nullptr);
    if (reference) {
      measures.reference = reference->reference;
      measures.estimate_error = estimate_error(points, *reference);
    }
    return measures;
  };
  co_return co_await maths_.run(std::move(job));
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
