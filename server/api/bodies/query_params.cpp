// The reading of query parameters; std::from_chars takes no sign, space or rest that is not asked for.
#include "server/api/bodies/query_params.hpp"

#include <fmt/format.h>

#include <charconv>
#include <limits>

#include "server/api/bodies/json.hpp"

namespace server::api {
namespace {

constexpr std::int64_t kLatest = (std::int64_t{1} << 53) - 1;  // that a JavaScript number holds
constexpr std::size_t kMaxQuotedParameter = 40;

}  // namespace

Result<std::int64_t> query_number(const http::Request& request, const std::string& name, std::int64_t minimum,
                                  std::int64_t maximum, std::int64_t fallback) {
  const auto given = request.query.find(name);
  if (given == request.query.end()) return fallback;
  const std::string& text = given->second;
  std::int64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || rest != end || value < minimum || value > maximum) {
    return fail(ErrorCode::bad_request,
                fmt::format("{} = '{}' is not a number from {} to {}", name, text.substr(0, kMaxQuotedParameter),
                            minimum, maximum),
                "out_of_range");
  }
  return value;
}

Result<std::optional<bool>> query_flag(const http::Request& request, const std::string& name) {
  const auto given = request.query.find(name);
  if (given == request.query.end()) return std::optional<bool>{};
  if (given->second == "true" || given->second == "false") return given->second == "true";
  return fail(ErrorCode::bad_request,
              fmt::format("{} = '{}' is not true or false", name, given->second.substr(0, kMaxQuotedParameter)),
              "out_of_range");
}

std::string cursor_text(const storage::SampleCursor& cursor) { return fmt::format("{}-{}", cursor.span, cursor.seq); }

std::optional<storage::SampleCursor> parse_cursor(const std::string& text) {
  storage::SampleCursor cursor;
  const char* end = text.data() + text.size();
  const auto span = std::from_chars(text.data(), end, cursor.span);
  if (span.ec != std::errc{} || span.ptr == end || *span.ptr != '-') return std::nullopt;
  const auto seq = std::from_chars(span.ptr + 1, end, cursor.seq);
  const bool is_number = seq.ec == std::errc{} && seq.ptr == end;
  if (!is_number || cursor.seq > std::numeric_limits<std::int64_t>::max()) return std::nullopt;  // beyond any sample
  return cursor;
}

Result<std::optional<storage::SampleCursor>> query_cursor(const http::Request& request) {
  const auto given = request.query.find("after");
  if (given == request.query.end()) return std::optional<storage::SampleCursor>{};
  const auto cursor = parse_cursor(given->second);
  if (!cursor) return fail(ErrorCode::bad_request, "after is not the `next` of a page", "out_of_range");
  return cursor;
}

Result<storage::Channels> query_channels(const http::Request& request) {
  const auto given = request.query.find("channels");
  if (given == request.query.end()) return storage::all_channels();
  return storage::parse_channels(given->second);
}

Result<storage::OverviewChannels> query_overview_channels(const http::Request& request) {
  const auto given = request.query.find("channels");
  if (given == request.query.end()) return storage::overview_channels(storage::all_channels());
  return storage::parse_overview_channels(given->second);
}

Result<std::optional<storage::TimeWindow>> query_window(const http::Request& request) {
  const auto from_us = query_number(request, "from_us", 0, kLatest - 1, 0);
  if (!from_us) return std::unexpected{from_us.error()};
  const auto to_us = query_number(request, "to_us", *from_us + 1, kLatest, kLatest);
  if (!to_us) return std::unexpected{to_us.error()};
  if (!request.query.contains("from_us") && !request.query.contains("to_us"))
    return std::optional<storage::TimeWindow>{};
  return storage::TimeWindow{*from_us, *to_us};
}

Result<storage::RecordFilter> query_record_filter(const http::Request& request) {
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) return std::unexpected{limit.error()};
  const auto window = query_window(request);
  if (!window) return std::unexpected{window.error()};
  const auto renewals = query_flag(request, "renewals");
  if (!renewals) return std::unexpected{renewals.error()};
  storage::RecordFilter filter{.limit = static_cast<std::size_t>(*limit)};
  if (*window) filter.window = **window;
  filter.has_renewals = renewals->value_or(true);
  return filter;
}

Result<storage::RunId> run_id_of(const http::Request& request) {
  const std::string& text = request.param.at("run_id");
  const auto id = parse_id(text);
  if (id && *id <= std::uint64_t{kMaxRunId}) return static_cast<storage::RunId>(*id);
  return fail(ErrorCode::bad_request, fmt::format("run_id = '{}' is not a number from 1", text.substr(0, 40)),
              "out_of_range");
}

Result<storage::Excerpt> run_excerpt(const http::Request& request) {
  const auto run = run_id_of(request);
  if (!run) return std::unexpected{run.error()};
  const auto window = query_window(request);
  if (!window) return std::unexpected{window.error()};
  return storage::Excerpt{.run = *run, .robot_id = {}, .window = *window};
}

Result<storage::Excerpt> robot_excerpt(const http::Request& request) {
  const auto window = query_window(request);
  if (!window) return std::unexpected{window.error()};
  return storage::Excerpt{.run = {}, .robot_id = request.param.at("robot_id"), .window = *window};
}

}  // namespace server::api
