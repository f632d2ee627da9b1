// Feeds any text to the readers of an HTTP target: path, query parameters, numbers within limits and cursors. Whatever
// they do not take is answered with a problem of the client's making that is valid JSON; what they take means what it
// says.
#include <algorithm>
#include <cstdlib>
#include <limits>
#include <string_view>

#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/runtime/tasks.hpp"
#include "tests/fuzz/targets.hpp"

namespace server {
namespace {

constexpr std::int64_t kMaximum = 10'000;
constexpr std::int64_t kMinGridUs = 100;  // as routes_exports.cpp has it
constexpr std::int64_t kMaxGridUs = 3'600'000'000;

void require(bool condition) {
  if (!condition) std::abort();
}

bool has_control_character(const std::string& text) {
  return std::ranges::any_of(text, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

std::string percent_encode(const std::string& text) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    out += {'%', kDigits[byte / 16], kDigits[byte % 16]};
  }
  return out;
}

void decode(std::string_view text) {
  for (const bool plus_is_space : {false, true}) {
    const auto decoded = http::percent_decode(text, plus_is_space);
    if (!decoded) continue;
    require(!has_control_character(*decoded) && decoded->size() <= text.size());
    require(http::percent_decode(percent_encode(*decoded), plus_is_space) == decoded);
  }
}

// A segment never hides a way to another folder.
void read_target(const std::string& text) {
  const http::Target target{text};
  require(target.is_acceptable() == !target.path().empty());
  for (const std::string& segment : target.segments()) {
    require(segment != "." && segment != ".." && segment.find_first_of("/\\") == std::string::npos);
    require(!has_control_character(segment));
  }
  const auto query = target.query();
  for (const auto& [name, value] : query.value_or(http::Target::Query{})) {
    require(!has_control_character(name) && !has_control_character(value));
  }
}

void read_cursor(const std::string& text) {
  const auto cursor = api::parse_cursor(text);
  if (!cursor) return;
  require(cursor->seq + 1 != 0);  // a page begins there
  const auto again = api::parse_cursor(api::cursor_text(*cursor));
  require(again && again->span == cursor->span && again->seq == cursor->seq);
}

// What the routes do with their parameters, without what they ask.
http::Answer answer(http::Request request) {
  const auto limit = api::query_number(request, "limit", 1, kMaximum, 100);
  if (!limit) co_return http::problem(limit.error());
  require(*limit >= 1 && *limit <= kMaximum);
  const auto before = api::query_number(request, "before", 1, std::numeric_limits<std::int64_t>::max(), 0);
  if (!before) co_return http::problem(before.error());
  require(*before >= 0);
  const auto points = api::query_number(request, "points", 1, kMaximum, 2000);
  if (!points) co_return http::problem(points.error());
  require(*points >= 1 && *points <= kMaximum);
  const auto grid_us = api::query_number(request, "grid_us", kMinGridUs, kMaxGridUs, 0);
  if (!grid_us) co_return http::problem(grid_us.error());
  require(*grid_us == 0 || (*grid_us >= kMinGridUs && *grid_us <= kMaxGridUs));
  if (request.param.contains("run_id")) {
    const auto run_id = api::run_id_of(request);
    if (!run_id) co_return http::problem(run_id.error());
  }
  for (const auto& [name, value] : request.query) read_cursor(value);
  const auto channels = api::query_channels(request);
  if (!channels) co_return http::problem(channels.error());
  require(channels->any());
  const auto of_overview = api::query_overview_channels(request);
  require(of_overview && of_overview->any());  // whatever samples have, overviews have
  const auto window = api::query_window(request);
  if (!window) co_return http::problem(window.error());
  require(!*window || ((*window)->from_us >= 0 && (*window)->to_us > (*window)->from_us));
  co_return http::json_response(200, {{"path", request.path}, {"query", request.query}});
}

// run_first wants a result that can be made before it is known.
boost::asio::awaitable<http::Response> dispatch(const http::Router& router, http::Request request) {
  co_return co_await router.dispatch(std::move(request));
}

void ask(const std::string& target) {
  http::Router router;
  router.add({"GET", "/api/v1/runs", identity::Scope::anyone, {"limit", "before", "robot_id"}, answer});
  router.add({"POST", "/api/v1/runs", identity::Scope::anyone, {}, answer});
  router.add({"GET", "/api/v1/runs/{run_id}/samples", identity::Scope::anyone, {"limit", "after"}, answer});
  router.add({"GET",
              "/api/v1/runs/{run_id}/overview",
              identity::Scope::anyone,
              {"from_us", "to_us", "points", "channels"},
              answer});
  router.add({"GET", "/api/v1/runs/{run_id}/samples.csv", identity::Scope::anyone, {"channels", "grid_us"}, answer});
  router.set_fallback([](const http::Request& request) { return http::json_response(200, {{"page", request.path}}); });
  for (const char* method : {"GET", "HEAD", "POST"}) {
    boost::asio::io_context loop;
    http::Request request;
    request.method = method;
    request.target = target;
    const http::Response response = runtime::run_first(loop, dispatch(router, std::move(request)));
    require(response.status == 200 || (response.status >= 400 && response.status < 500));
    require(nlohmann::json::accept(response.body));
  }
}

}  // namespace
}  // namespace server

int fuzz::query(const std::uint8_t* data, std::size_t size) {
  const std::string text{reinterpret_cast<const char*>(data), size};
  server::decode(text);
  server::read_target(text);
  server::read_cursor(text);
  server::ask(text);
  return 0;
}
