// What was recorded: samples of a run or a robot as JSON pages, and what is missing.
#include "server/api/bodies/column_text.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/storage/query/history.hpp"

namespace server::api {
namespace {

constexpr std::int64_t kMaxPage = storage::kMaxPageSamples;
constexpr std::int64_t kDefaultPage = 1000;

// Text of many samples takes milliseconds: it is made on the readers' thread, never on the loop.
http::Answer list_samples(SampleRoutes parts, http::Request request, storage::Excerpt excerpt) {
  const auto limit = query_number(request, "limit", 1, kMaxPage, kDefaultPage);
  if (!limit) co_return http::problem(limit.error());
  const auto after = query_cursor(request);
  if (!after) co_return http::problem(after.error());
  storage::History& history = parts.history;
  auto page = co_await history.segments(std::move(excerpt), *after, static_cast<std::size_t>(*limit));
  if (!page) co_return http::problem(page.error());
  auto job = [page = std::move(*page)] { return page_text(page); };
  std::string text = co_await history.reader().run(std::move(job));
  co_return http::json_text_response(200, std::move(text));
}

http::Answer list_gaps(SampleRoutes parts, http::Request request, storage::Excerpt excerpt) {
  const auto limit = query_number(request, "limit", 1, static_cast<std::int64_t>(storage::kMaxPageGaps), kDefaultPage);
  if (!limit) co_return http::problem(limit.error());
  const auto after = query_cursor(request);
  if (!after) co_return http::problem(after.error());
  storage::History& history = parts.history;
  auto found = co_await history.gaps(std::move(excerpt), *after, static_cast<std::size_t>(*limit));
  if (!found) co_return http::problem(found.error());
  auto job = [found = std::move(*found)] { return absences_text(found); };
  std::string text = co_await history.reader().run(std::move(job));
  co_return http::json_text_response(200, std::move(text));
}

// The same route for a run and for a robot.
using ExcerptRoute = http::Answer (*)(SampleRoutes, http::Request, storage::Excerpt);
using ExcerptOf = Result<storage::Excerpt> (*)(const http::Request&);

http::Answer answer_excerpt(SampleRoutes parts, http::Request request, ExcerptOf excerpt_of, ExcerptRoute answer) {
  auto excerpt = excerpt_of(request);
  if (!excerpt) co_return http::problem(excerpt.error());
  co_return co_await answer(parts, std::move(request), std::move(*excerpt));
}

}  // namespace

void add_sample_routes(http::Router& router, SampleRoutes parts) {
  const auto add = [&router, parts](const char* pattern, std::vector<std::string> query, ExcerptOf excerpt_of,
                                    ExcerptRoute answer) {
    router.add(
        {"GET", pattern, identity::Scope::read, std::move(query), [parts, excerpt_of, answer](http::Request request) {
           return answer_excerpt(parts, std::move(request), excerpt_of, answer);
         }});
  };
  add("/api/v1/runs/{run_id}/samples", {"after", "limit"}, run_excerpt, list_samples);
  add("/api/v1/robots/{robot_id}/samples", {"from_us", "to_us", "after", "limit"}, robot_excerpt, list_samples);
  add("/api/v1/runs/{run_id}/gaps", {"after", "limit"}, run_excerpt, list_gaps);
  add("/api/v1/robots/{robot_id}/gaps", {"from_us", "to_us", "after", "limit"}, robot_excerpt, list_gaps);
}

}  // namespace server::api
