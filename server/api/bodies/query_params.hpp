// Query parameters of the routes as values: numbers within limits, cursors, channels, windows of time.
//
// Each gives bad_request with the name and the value of a parameter that is not acceptable. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/http/http.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/runs/markers.hpp"

namespace server::api {

// A number within limits; `fallback` when it is not given.
Result<std::int64_t> query_number(const http::Request& request, const std::string& name, std::int64_t minimum,
                                  std::int64_t maximum, std::int64_t fallback);

// `true` or `false`; none when it is not given.
Result<std::optional<bool>> query_flag(const http::Request& request, const std::string& name);

// `robot_id`, of robots that may also be unknown; none when it is not given.
Result<std::optional<std::string>> query_robot(const http::Request& request);

// Cursors: the `next` of a page, with which the following one is asked for. Of a list of what has a number it is that
// number; else numbers with '-' between them, opaque to their users: samples "span-seq", events and commands
// "time-row", markers of a run "span-seq-marker".
std::string cursor_text(const storage::SampleCursor& cursor);
std::string cursor_text(const storage::RecordCursor& cursor);
std::string cursor_text(const storage::MarkerCursor& cursor);
std::optional<storage::SampleCursor> parse_cursor(const std::string& text);
// `after`; none when it is not given.
Result<std::optional<storage::SampleCursor>> query_cursor(const http::Request& request);
Result<std::optional<storage::MarkerCursor>> query_marker_cursor(const http::Request& request);
// `before` or `after` of a list whose cursors are numbers; `first` when it is not given.
Result<std::int64_t> query_number_cursor(const http::Request& request, const char* name, std::int64_t first = 0);

// `channels`: names with commas between them, each once; all when it is not given.
Result<storage::Channels> query_channels(const http::Request& request);
// The same for overviews, which have more channels; those of samples when it is not given.
Result<storage::OverviewChannels> query_overview_channels(const http::Request& request);

// `from_us` and `to_us`, UTC, the second above the first; none when neither is given.
Result<std::optional<storage::TimeWindow>> query_window(const http::Request& request);

inline constexpr std::int64_t kMaxRunId = 9'007'199'254'740'991;  // the largest integer that JavaScript holds
Result<storage::RunId> run_id_of(const http::Request& request);   // of the path

inline constexpr std::int64_t kDefaultLimit = 100;  // of the entries of a list
inline constexpr std::int64_t kMaxLimit = 1000;
Result<std::size_t> query_limit(const http::Request& request);
// `limit`, the window, `before`, and for commands `renewals`.
Result<storage::RecordFilter> query_record_filter(const http::Request& request);

// What the path's run_id or robot_id and the window name.
Result<storage::Excerpt> run_excerpt(const http::Request& request);
Result<storage::Excerpt> robot_excerpt(const http::Request& request);

}  // namespace server::api
