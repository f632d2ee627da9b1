// Reads a design, and checks that the command line tools would read its document.
#include "server/api/bodies/design_body.hpp"

#include <fmt/format.h>

#include "base/json_text.hpp"
#include "server/analysis/design_comparison.hpp"
#include "server/api/bodies/limits.hpp"

namespace server::api {
using nlohmann::json;

namespace {

Result<std::optional<std::int64_t>> optional_id(const Members& body, const char* name, Range<std::int64_t> allowed) {
  if (!body.has(name)) return std::nullopt;
  const auto id = body.integer(name, allowed);
  if (!id) return std::unexpected{id.error()};
  return *id;
}

Result<storage::DesignSource> parse_source(const json& given) {
  if (!given.is_object()) return fail(ErrorCode::bad_request, "an element of runs is not an object", "wrong_type");
  const Members source{given};
  if (const auto known = source.only({"run_id", "span"}); !known) return std::unexpected{known.error()};
  const auto run = source.integer("run_id", integers("DesignBody.runs[].run_id"));
  if (!run) return std::unexpected{run.error()};
  const auto span = optional_id(source, "span", integers("DesignBody.runs[].span"));
  if (!span) return std::unexpected{span.error()};
  storage::DesignSource parsed{*run, {}};
  if (*span) parsed.span = static_cast<std::uint32_t>(**span);
  return parsed;
}

Result<void> read_sources(const Members& body, std::vector<storage::DesignSource>& sources) {
  if (!body.has("runs")) return {};
  const json& runs = body.object().at("runs");
  constexpr Range<std::size_t> kAllowed = list_size("DesignBody.runs");
  if (!runs.is_array() || runs.size() > kAllowed.maximum) {
    return fail(ErrorCode::bad_request, fmt::format("runs must be a list of at most {} objects", kAllowed.maximum),
                "wrong_type");
  }
  for (const json& given : runs) {
    const auto source = parse_source(given);
    if (!source) return std::unexpected{source.error()};
    sources.push_back(*source);
  }
  return {};
}

// An object of the body as text, if it is there.
Result<void> read_object(const Members& body, const char* name, std::string& into) {
  if (!body.has(name)) return {};
  const json& value = body.object().at(name);
  if (!value.is_object()) return fail(ErrorCode::bad_request, fmt::format("{} must be an object", name), "wrong_type");
  into = base::dump(value);
  return {};
}

Result<void> read_texts(const Members& body, storage::DesignRequest& request) {
  const auto kind = body.text("kind", {0, kMaxWordBytes});
  if (!kind) return std::unexpected{kind.error()};
  const auto known = storage::design_kind_from(*kind);
  if (!known) {
    return fail(ErrorCode::invalid, fmt::format("kind is '{}', allowed are model and controller", *kind),
                "out_of_range");
  }
  request.kind = *known;
  const auto name = body.text("name", text_bytes("DesignBody.name"));
  if (!name) return std::unexpected{name.error()};
  request.name = *name;
  if (!body.has("notes")) return {};
  const auto notes = body.text("notes", text_bytes("DesignBody.notes"));
  if (!notes) return std::unexpected{notes.error()};
  request.notes = *notes;
  return {};
}

Result<void> read_relatives(const Members& body, DesignBody& parsed) {
  const auto parent = optional_id(body, "parent_id", integers("DesignBody.parent_id"));
  if (!parent) return std::unexpected{parent.error()};
  const auto model = optional_id(body, "model_id", integers("DesignBody.model_id"));
  if (!model) return std::unexpected{model.error()};
  const auto job = optional_id(body, "job_id", integers("DesignBody.job_id"));
  if (!job) return std::unexpected{job.error()};
  parsed.request.parent = *parent;
  parsed.request.model = *model;
  parsed.job = *job;
  if (*model && parsed.request.kind == storage::DesignKind::model) {
    return fail(ErrorCode::invalid, "model_id is of a controller; a model has a parent_id", "out_of_range");
  }
  return {};
}

Result<void> check_origin(const Members& body, const DesignBody& parsed) {
  if (body.has("document") == parsed.job.has_value()) {
    return fail(ErrorCode::bad_request, "give one of document and job_id", "missing_member");
  }
  if (!parsed.job) return analysis::check_document(parsed.request.kind, body.object().at("document"));
  for (const char* name : {"options", "runs"}) {
    if (body.has(name)) return fail(ErrorCode::bad_request, fmt::format("with job_id {} are the job's", name));
  }
  return {};
}

}  // namespace

Result<DesignBody> parse_design(const std::string& text) {
  const auto body =
      Members::parse(text, {"kind", "name", "notes", "document", "job_id", "parent_id", "model_id", "options", "runs"});
  if (!body) return std::unexpected{body.error()};
  DesignBody parsed;
  if (const auto read = read_texts(*body, parsed.request); !read) return std::unexpected{read.error()};
  if (const auto read = read_relatives(*body, parsed); !read) return std::unexpected{read.error()};
  if (const auto read = read_object(*body, "document", parsed.request.document); !read) {
    return std::unexpected{read.error()};
  }
  if (const auto read = read_object(*body, "options", parsed.request.options); !read) {
    return std::unexpected{read.error()};
  }
  if (const auto read = read_sources(*body, parsed.request.sources); !read) return std::unexpected{read.error()};
  if (const auto checked = check_origin(*body, parsed); !checked) return std::unexpected{checked.error()};
  return parsed;
}

json to_json(const storage::Design& design) {
  const storage::DesignRequest& made = design.made;
  json out;
  out["design_id"] = design.id;
  out["kind"] = text(made.kind);
  out["name"] = made.name;
  out["notes"] = made.notes;
  out["sha256"] = design.sha256;
  out["parent_id"] = made.parent ? json(*made.parent) : json(nullptr);
  out["model_id"] = made.model ? json(*made.model) : json(nullptr);
  out["options"] = json::parse(made.options, nullptr, false);
  out["made_with"] = design.made_with;
  out["made_by"] = design.made_by;
  out["made_at_us"] = design.made_at_us;
  out["runs"] = json::array();
  for (const storage::DesignSource& source : made.sources) {
    out["runs"].push_back({{"run_id", source.run}, {"span", source.span ? json(*source.span) : json(nullptr)}});
  }
  return out;
}

}  // namespace server::api
