// Reads the members one by one; what is left out has the defaults of the command line.
#include "server/api/bodies/job_body.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <limits>

#include "base/json_text.hpp"
#include "server/analysis/control_json.hpp"
#include "server/api/bodies/document_body.hpp"
#include "server/api/bodies/limits.hpp"

namespace server::api {
using nlohmann::json;

namespace {

// One of the values by its text; `into` stays as it is when the member is left out.
template <class Value, std::size_t size>
Result<void> read_word(const Members& body, const char* name, const std::array<Value, size>& values, Value& into) {
  if (!body.has(name)) return {};
  const auto word = body.text(name, {0, kMaxWordBytes});
  if (!word) return std::unexpected{word.error()};
  std::vector<std::string> words;
  for (const Value value : values) {
    using analysis::text;
    if (*word == text(value)) {
      into = value;
      return {};
    }
    words.emplace_back(text(value));
  }
  return fail(ErrorCode::invalid, fmt::format("{} is '{}', allowed are {}", name, *word, fmt::join(words, ", ")),
              "out_of_range");
}

Result<void> read_number(const Members& body, const char* name, Range<double> allowed, double& into) {
  const auto value = body.optional_number(name, allowed);
  if (!value) return std::unexpected{value.error()};
  into = value->value_or(into);
  return {};
}

struct WindowNames {
  const char *span, *from_s, *to_s;
};
constexpr WindowNames kWindow{"span", "from_s", "to_s"};  // of IdentifyJobBody and of its runs[], with one range each

Result<void> read_window(const Members& body, const WindowNames& names, analysis::RunWindow& window) {
  if (body.has(names.span)) {
    const auto span = body.integer(names.span, integers("IdentifyJobBody.span"));
    if (!span) return std::unexpected{span.error()};
    window.span = static_cast<std::uint32_t>(*span);
  }
  if (const auto read = read_number(body, names.from_s, numbers("IdentifyJobBody.from_s"), window.from_s); !read) {
    return read;
  }
  if (const auto read = read_number(body, names.to_s, numbers("IdentifyJobBody.to_s"), window.to_s); !read) return read;
  if (window.from_s < window.to_s) return {};
  return fail(
      ErrorCode::invalid,
      fmt::format("{} is {}, it must be below {}, which is {}", names.from_s, window.from_s, names.to_s, window.to_s),
      "out_of_range");
}

// The names under which a reader of a job's warnings can give the options that they advise. A reader is at the page, or
// at autotune, which begins its job without these options.
const control::OptionNames kAdvice{"rheonaut identify --dead-time-s; dead_time_s of a job",
                                   "rheonaut identify --sensor-lag-s; sensor_lag_s of a job",
                                   "rheonaut identify --offset; fits_offset of a job", "a structure that is given"};

Result<void> read_search(const Members& body, control::IdentificationOptions& search) {
  using control::Cost;
  using control::Structure;
  constexpr std::array kStructures{Structure::first_order, Structure::second_order, Structure::fractional};
  constexpr std::array kCosts{Cost::least_squares, Cost::absolute_error};
  if (body.has("structure")) {
    Structure structure{};
    if (const auto read = read_word(body, "structure", kStructures, structure); !read) return read;
    search.structure = structure;
  }
  if (const auto read = read_word(body, "cost", kCosts, search.cost); !read) return read;
  if (body.has("fits_offset")) {
    const auto fits_offset = body.flag("fits_offset");
    if (!fits_offset) return std::unexpected{fits_offset.error()};
    search.fits_offset = *fits_offset;
  }
  const Range<double> time_limit_s = numbers("IdentifyJobBody.time_limit_s");
  if (const auto read = read_number(body, "time_limit_s", time_limit_s, search.time_limit_s); !read) return read;
  const Range<double> dead_time_s = numbers("IdentifyJobBody.dead_time_s");
  if (const auto read = read_number(body, "dead_time_s", dead_time_s, search.longest_dead_time_s); !read) return read;
  search.tries_dead_time = !body.has("dead_time_s");
  const auto lag_s = body.optional_number("sensor_lag_s", numbers("IdentifyJobBody.sensor_lag_s"));
  if (!lag_s) return std::unexpected{lag_s.error()};
  search.sensor_lag_s = *lag_s;
  search.names = kAdvice;
  return {};
}

Result<void> read_validation(const Members& body, analysis::IdentifyRequest& request) {
  if (body.has("validation_run_id")) {
    const auto run = body.integer("validation_run_id", integers("IdentifyJobBody.validation_run_id"));
    if (!run) return std::unexpected{run.error()};
    request.validation = analysis::RunPart{*run, {}};
  }
  constexpr WindowNames kNames{"validation_span", "validation_from_s", "validation_to_s"};
  for (const char* name : {kNames.span, kNames.from_s, kNames.to_s}) {
    if (!body.has(name) || request.validation) continue;
    return fail(ErrorCode::invalid, fmt::format("{} needs validation_run_id", name), "out_of_range");
  }
  return request.validation ? read_window(body, kNames, request.validation->window) : Result<void>{};
}

Result<analysis::RunPart> read_part(const Members& body, Range<std::int64_t> ids) {
  const auto run = body.integer("run_id", ids);
  if (!run) return std::unexpected{run.error()};
  analysis::RunPart part{*run, {}};
  if (const auto read = read_window(body, kWindow, part.window); !read) return std::unexpected{read.error()};
  return part;
}

Result<analysis::RunPart> read_element(const json& given, std::size_t index) {
  if (!given.is_object()) {
    return fail(ErrorCode::bad_request, fmt::format("runs[{}] is not an object", index), "wrong_type");
  }
  const Members element{given};
  Result<analysis::RunPart> part = analysis::RunPart{};
  if (const auto known = element.only({"run_id", "span", "from_s", "to_s"}); !known) {
    part = std::unexpected{known.error()};
  } else {
    part = read_part(element, integers("IdentifyJobBody.runs[].run_id"));
  }
  if (part) return part;
  Error error = part.error();
  error.detail = fmt::format("runs[{}]: {}", index, error.detail);
  return std::unexpected{std::move(error)};
}

// Either run_id with its window, or runs, each with its own.
Result<void> read_runs(const Members& body, std::vector<analysis::RunPart>& runs) {
  if (!body.has("runs")) {
    auto part = read_part(body, integers("IdentifyJobBody.run_id"));
    if (!part) return std::unexpected{part.error()};
    runs.push_back(*part);
    return {};
  }
  for (const char* name : {"run_id", kWindow.span, kWindow.from_s, kWindow.to_s}) {
    if (body.has(name)) {
      return fail(ErrorCode::bad_request, fmt::format("{} stands beside runs; give it in the elements of runs", name),
                  "unknown_member");
    }
  }
  const json& given = body.object().at("runs");
  constexpr Range<std::size_t> kAllowed = list_size("IdentifyJobBody.runs");
  if (!given.is_array() || given.size() < kAllowed.minimum || given.size() > kAllowed.maximum) {
    return fail(ErrorCode::bad_request,
                fmt::format("runs must be a list of {} to {} objects", kAllowed.minimum, kAllowed.maximum),
                "wrong_type");
  }
  for (std::size_t i = 0; i < given.size(); ++i) {
    const auto part = read_element(given[i], i);
    if (!part) return std::unexpected{part.error()};
    runs.push_back(*part);
  }
  return {};
}

Result<analysis::IdentifyRequest> identify_request(const Members& body) {
  using analysis::ChannelChoice;
  if (const auto known = body.only({"kind",
                                    "run_id",
                                    "runs",
                                    "span",
                                    "from_s",
                                    "to_s",
                                    "channels",
                                    "structure",
                                    "cost",
                                    "fits_offset",
                                    "dead_time_s",
                                    "sensor_lag_s",
                                    "time_limit_s",
                                    "with_velocity",
                                    "cut_at_gaps",
                                    "residuals",
                                    "validation_run_id",
                                    "validation_span",
                                    "validation_from_s",
                                    "validation_to_s"});
      !known) {
    return std::unexpected{known.error()};
  }
  analysis::IdentifyRequest request;
  if (const auto read = read_runs(body, request.runs); !read) return std::unexpected{read.error()};
  constexpr std::array kChannels{ChannelChoice::best, ChannelChoice::outside, ChannelChoice::robot};
  if (const auto read = read_word(body, "channels", kChannels, request.channels); !read) {
    return std::unexpected{read.error()};
  }
  const auto with_velocity = body.flag("with_velocity"), cut_at_gaps = body.flag("cut_at_gaps");
  const auto residuals = body.flag("residuals");
  if (!with_velocity) return std::unexpected{with_velocity.error()};
  if (!cut_at_gaps) return std::unexpected{cut_at_gaps.error()};
  if (!residuals) return std::unexpected{residuals.error()};
  request.with_residuals = *residuals;
  if (const auto read = read_search(body, request.search); !read) return std::unexpected{read.error()};
  if (const auto read = read_validation(body, request); !read) return std::unexpected{read.error()};
  const auto complete = [&](analysis::RunWindow& window) {
    window.with_velocity = *with_velocity;
    window.cuts_at_gaps = *cut_at_gaps;
  };
  for (analysis::RunPart& part : request.runs) complete(part.window);
  if (request.validation) complete(request.validation->window);
  return request;
}

template <class Request>
Result<JobBody> job_of(const Members& body, const std::string& kind, Result<Request> request) {
  if (!request) return std::unexpected{request.error()};
  return JobBody{kind, std::move(*request), base::dump(body.object())};
}

}  // namespace

Result<JobBody> parse_job(const std::string& text) {
  const auto body = Members::parse(text, {});
  if (!body) return std::unexpected{body.error()};
  const auto kind = body->text("kind", {0, kMaxWordBytes});
  if (!kind) return std::unexpected{kind.error()};
  if (*kind == "identify") return job_of(*body, *kind, identify_request(*body));
  if (*kind == "tune") return job_of(*body, *kind, tune_body(*body));
  if (*kind == "tuning_map") return job_of(*body, *kind, tuning_map_body(*body));
  if (*kind == "tune_measured") return job_of(*body, *kind, tune_measured_body(*body));
  constexpr std::array<std::string_view, 3> kDocuments{"report", "comparison", "export"};
  if (std::ranges::find(kDocuments, *kind) != kDocuments.end()) {
    return job_of(*body, *kind, parse_document_job(*kind, *body));
  }
  return fail(ErrorCode::invalid,
              fmt::format("kind is '{}', allowed are identify, tune, tuning_map, tune_measured, {}", *kind,
                          fmt::join(kDocuments, ", ")),
              "unknown_kind");
}

json to_json(const storage::Job& job) {
  json out;
  out["job_id"] = job.id;
  out["kind"] = job.request.kind;
  out["state"] = text(job.state);
  out["owner"] = job.request.owner;
  out["request"] = json::parse(job.request.document, nullptr, false);
  out["created_at_us"] = job.created_at_us;
  out["started_at_us"] = job.started_at_us ? json(*job.started_at_us) : json(nullptr);
  out["ended_at_us"] = job.ended_at_us ? json(*job.ended_at_us) : json(nullptr);
  out["error"] = job.error.empty() ? json(nullptr) : json(job.error);
  out["cancelling"] = job.is_being_cancelled;
  out["progress"] = nullptr;
  if (job.progress) out["progress"] = {{"share", job.progress->share}, {"stage", job.progress->stage}};
  return out;
}

}  // namespace server::api
