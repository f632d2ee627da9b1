// Overviews of a run and of a robot's recording: the least and the largest values, a point per pixel.
#include "server/api/bodies/column_text.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/storage/query/history.hpp"

namespace server::api {
namespace {

constexpr std::int64_t kMaxPoints = 10'000;
constexpr std::int64_t kDefaultPoints = 2'000;

http::Answer overview(OverviewRoutes parts, http::Request request, storage::Excerpt excerpt) {
  const auto points = query_number(request, "points", 1, kMaxPoints, kDefaultPoints);
  if (!points) co_return http::problem(points.error());
  const auto channels = query_overview_channels(request);
  if (!channels) co_return http::problem(channels.error());
  const storage::OverviewQuery query{.points = static_cast<std::size_t>(*points), .channels = *channels};
  auto found = co_await parts.history.overview(std::move(excerpt), query);
  if (!found) co_return http::problem(found.error());
  auto job = [found = std::move(*found), channels = *channels] { return overview_text(found, channels); };
  std::string text = co_await parts.history.reader().run(std::move(job));
  co_return http::json_text_response(200, std::move(text));
}

http::Answer overview_of_run(OverviewRoutes parts, http::Request request) {
  auto excerpt = run_excerpt(request);
  if (!excerpt) co_return http::problem(excerpt.error());
  co_return co_await overview(parts, std::move(request), std::move(*excerpt));
}

http::Answer overview_of_robot(OverviewRoutes parts, http::Request request) {
  auto excerpt = robot_excerpt(request);
  if (!excerpt) co_return http::problem(excerpt.error());
  co_return co_await overview(parts, std::move(request), std::move(*excerpt));
}

}  // namespace

void add_overview_routes(http::Router& router, OverviewRoutes parts) {
  const auto add = [&router, parts](const char* pattern, http::Answer (*answer)(OverviewRoutes, http::Request)) {
    router.add(
        {"GET", pattern, identity::Scope::read, {"from_us", "to_us", "points", "channels"}, with(parts, answer)});
  };
  add("/api/v1/runs/{run_id}/overview", overview_of_run);
  add("/api/v1/robots/{robot_id}/overview", overview_of_robot);
}

}  // namespace server::api
