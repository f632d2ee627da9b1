// A query becomes an object like the body's `traces`, so that both are read once.
#include "server/api/bodies/document_body.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iterator>

#include "server/api/bodies/limits.hpp"
#include "server/api/bodies/query_params.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr const char* kWordsOfTraces[] = {"at", "event", "marker"};
constexpr const char* kChannels = "channels";
constexpr const char* kNumbersOfTraces[] = {"number", "grid_us", "from_ms", "to_ms", "reference_run_id"};
constexpr std::size_t kMostQuotedText = 40;

Result<void> read_integer(const Members& body, const char* name, Range<std::int64_t> allowed, auto into) {
  if (!body.has(name)) return {};
  const auto value = body.integer(name, allowed);
  if (!value) return std::unexpected{value.error()};
  into(*value);
  return {};
}

Result<analysis::AlignAt> read_at(const Members& body) {
  if (!body.has("at")) return analysis::AlignAt::start;
  const auto word = body.text("at", {0, kMaxWordBytes});
  if (!word) return std::unexpected{word.error()};
  for (const analysis::AlignAt at : analysis::kAlignments) {
    if (*word == text(at)) return at;
  }
  return fail(ErrorCode::invalid, fmt::format("at is '{}', allowed are start, step, disturbance, event, marker", *word),
              "out_of_range");
}

// `event` belongs to the alignment event, and `marker` to that of markers.
Result<std::string> read_name(const Members& body, analysis::AlignAt at) {
  const std::pair<const char*, analysis::AlignAt> belongings[] = {{"event", analysis::AlignAt::event},
                                                                  {"marker", analysis::AlignAt::marker}};
  for (const auto& [name, of] : belongings) {
    if (body.has(name) && at != of) {
      return fail(ErrorCode::invalid, fmt::format("{0} needs at = {0}, which is {1}", name, text(at)), "out_of_range");
    }
  }
  if (at == analysis::AlignAt::event) return body.text("event", text_bytes("TracesBody.event"));
  if (body.has("marker")) return body.text("marker", text_bytes("TracesBody.marker"));
  return std::string{};
}

Result<analysis::Alignment> read_alignment(const Members& body) {
  analysis::Alignment alignment;
  const auto at = read_at(body);
  if (!at) return std::unexpected{at.error()};
  alignment.at = *at;
  auto name = read_name(body, *at);
  if (!name) return std::unexpected{name.error()};
  alignment.name = std::move(*name);
  const auto number = read_integer(body, "number", integers("TracesBody.number"),
                                   [&](std::int64_t value) { alignment.number = static_cast<int>(value); });
  if (!number) return std::unexpected{number.error()};
  if (const auto fits = check_alignment(alignment); !fits) return std::unexpected{fits.error()};
  return alignment;
}

Result<void> read_window_and_grid(const Members& body, analysis::TracesRequest& request) {
  const auto grid = read_integer(body, "grid_us", integers("TracesBody.grid_us"),
                                 [&](std::int64_t value) { request.grid_us = value; });
  if (!grid) return grid;
  const auto from = read_integer(body, "from_ms", integers("TracesBody.from_ms"),
                                 [&](std::int64_t value) { request.from_s = 1e-3 * static_cast<double>(value); });
  if (!from) return from;
  const auto to = read_integer(body, "to_ms", integers("TracesBody.to_ms"),
                               [&](std::int64_t value) { request.to_s = 1e-3 * static_cast<double>(value); });
  if (!to) return to;
  if (request.from_s < request.to_s) return {};
  return fail(
      ErrorCode::invalid,
      fmt::format("from_ms is at {} s, it must be before to_ms, which is at {} s", request.from_s, request.to_s),
      "out_of_range");
}

Result<void> read_reference(const Members& body, const std::vector<storage::RunId>& runs,
                            analysis::TracesRequest& request) {
  const auto read = read_integer(body, "reference_run_id", integers("TracesBody.reference_run_id"),
                                 [&](std::int64_t value) { request.reference_run = value; });
  if (!read || !request.reference_run || std::ranges::find(runs, *request.reference_run) != runs.end()) return read;
  return fail(ErrorCode::invalid,
              fmt::format("reference_run_id is {}, which is none of the runs", *request.reference_run), "out_of_range");
}

Result<analysis::TracesRequest> read_traces(const Members& body, const std::vector<storage::RunId>& runs) {
  analysis::TracesRequest request;
  const auto alignment = read_alignment(body);
  if (!alignment) return std::unexpected{alignment.error()};
  request.alignment = *alignment;
  std::string channels = analysis::kUsualChannels;
  if (body.has(kChannels)) {
    auto given = body.text(kChannels, text_bytes("TracesBody.channels"));
    if (!given) return std::unexpected{given.error()};
    channels = std::move(*given);
  }
  auto parsed = analysis::parse_trace_channels(channels);
  if (!parsed) return std::unexpected{parsed.error()};
  request.channels = std::move(*parsed);
  if (const auto read = read_window_and_grid(body, request); !read) return std::unexpected{read.error()};
  if (const auto read = read_reference(body, runs, request); !read) return std::unexpected{read.error()};
  return request;
}

Result<void> check_each_once(const std::vector<storage::RunId>& runs) {
  for (auto run = runs.begin(); run != runs.end(); ++run) {
    if (std::find(std::next(run), runs.end(), *run) == runs.end()) continue;
    return fail(ErrorCode::invalid, fmt::format("runs has {} twice", *run), "out_of_range");
  }
  return {};
}

Result<std::vector<storage::RunId>> read_runs(const Members& body, Range<std::size_t> count) {
  if (!body.has("runs") || !body.object().at("runs").is_array()) {
    return fail(ErrorCode::bad_request, "runs is missing, a list such as [1, 2]", "missing_member");
  }
  const json& given = body.object().at("runs");
  if (given.size() < count.minimum || given.size() > count.maximum) {
    return fail(ErrorCode::invalid,
                fmt::format("runs has {}, allowed are {} to {}", given.size(), count.minimum, count.maximum),
                "out_of_range");
  }
  std::vector<storage::RunId> runs;
  for (const json& item : given) {
    json one = json::object();
    one["runs[]"] = item;
    const auto run = Members{std::move(one)}.integer("runs[]", integers("ComparisonJobBody.runs[]"));
    if (!run) return std::unexpected{run.error()};
    runs.push_back(*run);
  }
  if (const auto once = check_each_once(runs); !once) return std::unexpected{once.error()};
  return runs;
}

// The member `traces`, which may be left out.
Result<analysis::TracesRequest> read_traces_member(const Members& body, const std::vector<storage::RunId>& runs) {
  json object = body.object().value("traces", json::object());
  if (!object.is_object()) return fail(ErrorCode::bad_request, "traces is no object", "wrong_type");
  const Members traces{std::move(object)};
  const auto known =
      traces.only({"at", "event", "marker", "channels", "number", "grid_us", "from_ms", "to_ms", "reference_run_id"});
  if (!known) return std::unexpected{known.error()};
  return read_traces(traces, runs);
}

Result<analysis::DocumentRequest> read_comparison(const Members& body) {
  if (const auto known = body.only({"kind", "runs", "traces"}); !known) return std::unexpected{known.error()};
  auto runs = read_runs(body, list_size("ComparisonJobBody.runs"));
  if (!runs) return std::unexpected{runs.error()};
  auto traces = read_traces_member(body, *runs);
  if (!traces) return std::unexpected{traces.error()};
  return analysis::ComparisonRequest{std::move(*runs), std::move(*traces)};
}

Result<analysis::DocumentRequest> read_report(const Members& body) {
  if (const auto known = body.only({"kind", "runs", "traces"}); !known) return std::unexpected{known.error()};
  auto runs = read_runs(body, list_size("ReportJobBody.runs"));
  if (!runs) return std::unexpected{runs.error()};
  if (body.has("traces") && runs->size() == 1) {
    return fail(ErrorCode::invalid, "traces are of several runs that are compared", "out_of_range");
  }
  auto traces = read_traces_member(body, *runs);
  if (!traces) return std::unexpected{traces.error()};
  if (body.has("traces") && body.object().at("traces").contains(kChannels)) {
    return fail(ErrorCode::invalid, "channels are those of the report: leave them out", "out_of_range");
  }
  return analysis::ReportRequest{std::move(*runs), std::move(*traces)};
}

Result<storage::ExportFormat> read_format(const Members& body) {
  const auto word = body.text("format", {0, kMaxWordBytes});
  if (!word) return std::unexpected{word.error()};
  if (const auto format = storage::parse_export_format(*word)) return *format;
  return fail(ErrorCode::invalid, fmt::format("format is '{}', allowed are csv, mat, sqlite, mcap", *word),
              "out_of_range");
}

Result<analysis::DocumentRequest> read_export(const Members& body) {
  if (const auto known = body.only({"kind", "run_id", "format", "channels", "grid_us"}); !known) {
    return std::unexpected{known.error()};
  }
  analysis::ExportRequest request;
  const auto run = body.integer("run_id", integers("ExportJobBody.run_id"));
  if (!run) return std::unexpected{run.error()};
  request.query.run = *run;
  const auto format = read_format(body);
  if (!format) return std::unexpected{format.error()};
  request.format = *format;
  if (!storage::may_have_grid(request.format) && (body.has(kChannels) || body.has("grid_us"))) {
    return fail(ErrorCode::invalid,
                "a SQLite or MCAP file has every sample and channel: leave out channels and grid_us", "out_of_range");
  }
  if (body.has(kChannels)) {
    const auto names = body.text(kChannels, text_bytes("ExportJobBody.channels"));
    if (!names) return std::unexpected{names.error()};
    const auto channels = storage::parse_channels(*names);
    if (!channels) return std::unexpected{channels.error()};
    request.query.channels = *channels;
  }
  const auto grid = read_integer(body, "grid_us", integers("ExportJobBody.grid_us"),
                                 [&](std::int64_t value) { request.query.grid_us = value; });
  if (!grid) return std::unexpected{grid.error()};
  return request;
}

// A whole number, or an error that quotes what is none.
Result<std::int64_t> number_in_query(const std::string& name, const std::string& text) {
  std::int64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error == std::errc{} && rest == end) return value;
  return fail(ErrorCode::bad_request,
              fmt::format("{} = '{}' is no whole number", name, text.substr(0, kMostQuotedText)), "out_of_range");
}

}  // namespace

Result<std::vector<storage::RunId>> query_runs(const http::Request& request, std::size_t least, std::size_t most) {
  const auto given = request.query.find("runs");
  if (given == request.query.end())
    return fail(ErrorCode::bad_request, "runs is missing, e.g. runs=1,2", "missing_member");
  std::vector<storage::RunId> ids;
  const std::string& text = given->second;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const auto id = parse_id(text.substr(begin, end - begin));
    if (!id || *id > static_cast<std::uint64_t>(kMaxRunId)) {
      return fail(ErrorCode::bad_request, fmt::format("runs = '{}' is not a list such as 1,2", text), "out_of_range");
    }
    ids.push_back(static_cast<storage::RunId>(*id));
    begin = end + 1;
  }
  if (ids.size() >= least && ids.size() <= most) return ids;
  return fail(ErrorCode::bad_request, fmt::format("runs has {}, allowed are {} to {}", ids.size(), least, most),
              "out_of_range");
}

Result<double> query_bin_m(const http::Request& request) {
  const auto bin_mm =
      query_number(request, "bin_mm", analysis::kNarrowestBinMm, analysis::kWidestBinMm, analysis::kUsualBinMm);
  if (!bin_mm) return std::unexpected{bin_mm.error()};
  return 1e-3 * static_cast<double>(*bin_mm);
}

std::vector<std::string> traces_parameters() {
  std::vector<std::string> names{"runs"};
  names.insert(names.end(), std::begin(kWordsOfTraces), std::end(kWordsOfTraces));
  names.insert(names.end(), std::begin(kNumbersOfTraces), std::end(kNumbersOfTraces));
  return names;
}

std::vector<std::string> traces_parameters_and_channels() {
  std::vector<std::string> names = traces_parameters();
  names.emplace_back(kChannels);
  return names;
}

Result<analysis::TracesRequest> query_traces(const http::Request& request, const std::vector<storage::RunId>& runs) {
  if (const auto once = check_each_once(runs); !once) return std::unexpected{once.error()};
  json object = json::object();
  const auto add_word = [&](const char* name) {
    if (const auto given = request.query.find(name); given != request.query.end()) object[name] = given->second;
  };
  for (const char* name : kWordsOfTraces) add_word(name);
  add_word(kChannels);
  for (const char* name : kNumbersOfTraces) {
    const auto given = request.query.find(name);
    if (given == request.query.end()) continue;
    const auto number = number_in_query(name, given->second);
    if (!number) return std::unexpected{number.error()};
    object[name] = *number;
  }
  return read_traces(Members{std::move(object)}, runs);
}

Result<analysis::DocumentRequest> parse_document_job(const std::string& kind, const Members& body) {
  if (kind == "comparison") return read_comparison(body);
  return kind == "report" ? read_report(body) : read_export(body);
}

}  // namespace server::api
