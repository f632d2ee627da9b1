// The reading of query parameters; std::from_chars takes no sign, space or rest that is not asked for.
#include "server/api/bodies/query_params.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <limits>

#include "server/api/bodies/json.hpp"

namespace server::api {
namespace {

constexpr std::int64_t kLatest = (std::int64_t{1} << 53) - 1;  // that a JavaScript number holds
constexpr std::size_t kMaxQuotedParameter = 40;

// "12-345" as two numbers; none when the text is anything else.
template <std::size_t count>
std::optional<std::array<std::uint64_t, count>> numbers_in(const std::string& text) {
  std::array<std::uint64_t, count> numbers{};
  const char* at = text.data();
  const char* end = at + text.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0 && (at == end || *at++ != '-')) return std::nullopt;
    const auto [rest, error] = std::from_chars(at, end, numbers[i]);
    if (error != std::errc{}) return std::nullopt;
    at = rest;
  }
  if (at != end) return std::nullopt;
  return numbers;
}

bool is_span(std::uint64_t number) { return number <= std::numeric_limits<std::uint32_t>::max(); }
bool is_signed(std::uint64_t number) { return number <= std::uint64_t{std::numeric_limits<std::int64_t>::max()}; }

std::optional<storage::RecordCursor> parse_record_cursor(const std::string& text) {
  const auto numbers = numbers_in<2>(text);
  if (!numbers || (*numbers)[0] > kLatest) return std::nullopt;
  return storage::RecordCursor{static_cast<std::int64_t>((*numbers)[0]), static_cast<std::int64_t>((*numbers)[1])};
}

std::optional<storage::MarkerCursor> parse_marker_cursor(const std::string& text) {
  const auto numbers = numbers_in<3>(text);
  if (!numbers || !is_span((*numbers)[0]) || !is_signed((*numbers)[1]) || !is_signed((*numbers)[2]))
    return std::nullopt;
  return storage::MarkerCursor{static_cast<std::uint32_t>((*numbers)[0]), (*numbers)[1],
                               static_cast<std::int64_t>((*numbers)[2])};
}

Result<storage::RenewalRows> query_renewals(const http::Request& request) {
  const auto given = request.query.find("renewals");
  if (given == request.query.end() || given->second == "true") return storage::RenewalRows::all;
  if (given->second == "false") return storage::RenewalRows::none;
  if (given->second == "counted") return storage::RenewalRows::counted;
  return fail(
      ErrorCode::bad_request,
      fmt::format("renewals = '{}' is not true, false or counted", given->second.substr(0, kMaxQuotedParameter)),
      "out_of_range");
}

// None when the parameter is not given.
template <class Cursor, class Parse>
Result<std::optional<Cursor>> cursor_in(const http::Request& request, const char* name, Parse parse) {
  const auto given = request.query.find(name);
  if (given == request.query.end()) return std::optional<Cursor>{};
  const std::optional<Cursor> cursor = parse(given->second);
  if (cursor) return cursor;
  return fail(ErrorCode::bad_request,
              fmt::format("{} = '{}' is not the `next` of a page of this list; leave it out for the first page", name,
                          given->second.substr(0, kMaxQuotedParameter)),
              "out_of_range");
}

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

Result<std::optional<std::string>> query_robot(const http::Request& request) {
  const auto given = request.query.find("robot_id");
  if (given == request.query.end()) return std::optional<std::string>{};
  if (is_robot_id(given->second)) return given->second;
  return fail(ErrorCode::bad_request,
              fmt::format("robot_id = '{}' is not 1 to 31 characters of [a-z0-9_-]",
                          given->second.substr(0, kMaxQuotedParameter)),
              "out_of_range");
}

std::string cursor_text(const storage::SampleCursor& cursor) { return fmt::format("{}-{}", cursor.span, cursor.seq); }
std::string cursor_text(const storage::RecordCursor& cursor) {
  return fmt::format("{}-{}", cursor.at_us, static_cast<std::uint64_t>(cursor.row));
}
std::string cursor_text(const storage::MarkerCursor& cursor) {
  return fmt::format("{}-{}-{}", cursor.span, cursor.seq, cursor.id);
}

std::optional<storage::SampleCursor> parse_cursor(const std::string& text) {
  const auto numbers = numbers_in<2>(text);
  if (!numbers || !is_span((*numbers)[0]) || !is_signed((*numbers)[1])) return std::nullopt;
  return storage::SampleCursor{static_cast<std::uint32_t>((*numbers)[0]), (*numbers)[1]};
}

Result<std::optional<storage::SampleCursor>> query_cursor(const http::Request& request) {
  return cursor_in<storage::SampleCursor>(request, "after", parse_cursor);
}

Result<std::optional<storage::MarkerCursor>> query_marker_cursor(const http::Request& request) {
  return cursor_in<storage::MarkerCursor>(request, "after", parse_marker_cursor);
}

Result<std::int64_t> query_number_cursor(const http::Request& request, const char* name, std::int64_t first) {
  const auto cursor = cursor_in<std::int64_t>(request, name, [first](const std::string& text) {
    const auto number = numbers_in<1>(text);
    const bool is_within = number && (*number)[0] <= kLatest && static_cast<std::int64_t>((*number)[0]) > first;
    return is_within ? std::optional{static_cast<std::int64_t>((*number)[0])} : std::nullopt;
  });
  if (!cursor) return std::unexpected{cursor.error()};
  return cursor->value_or(first);
}

Result<std::size_t> query_limit(const http::Request& request) {
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) return std::unexpected{limit.error()};
  return static_cast<std::size_t>(*limit);
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
  const auto limit = query_limit(request);
  if (!limit) return std::unexpected{limit.error()};
  const auto window = query_window(request);
  if (!window) return std::unexpected{window.error()};
  const auto before = cursor_in<storage::RecordCursor>(request, "before", parse_record_cursor);
  if (!before) return std::unexpected{before.error()};
  const auto renewals = query_renewals(request);
  if (!renewals) return std::unexpected{renewals.error()};
  storage::RecordFilter filter;
  filter.limit = *limit;
  if (*window) filter.window = **window;
  filter.before = *before;
  filter.renewals = *renewals;
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
