// Jobs: begin, list, watch, take the result or the file, cancel.
#include <fmt/format.h>

#include "base/json_text.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/identify_job.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/analysis/job_file_stream.hpp"
#include "server/api/bodies/job_body.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/storage/designs/designs.hpp"
#include "server/storage/jobs/jobs.hpp"
#include "server/storage/runs/fluid_models.hpp"
#include "server/storage/runs/runs.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr std::int64_t kMaxWait_ms = 30'000;

Result<storage::JobId> job_id_of(const http::Request& request) {
  const auto id = parse_id(request.param.at("job_id"));
  if (id && *id <= static_cast<std::uint64_t>(kMaxRunId)) return static_cast<storage::JobId>(*id);
  return fail(ErrorCode::not_found, fmt::format("there is no job '{}'", request.param.at("job_id")), "no_such_job");
}

// The plant of a fluid's model, where its document says which plant it is of.
std::optional<control::FractionalModel> plant_of(const station::FluidModel& model) {
  const json document = json::parse(model.document, nullptr, false);
  if (!document.is_object() || !document.contains("plant")) return std::nullopt;
  const auto plant = analysis::model_from(document.at("plant"));
  return plant ? std::optional{*plant} : std::nullopt;
}

// The model that robots in this fluid are sent.
std::optional<analysis::ModelInUse> model_in_use(JobRoutes parts, const std::string& fluid) {
  const station::FluidModel* model = parts.fluid_models.in_force().find(fluid);
  const auto plant = model == nullptr ? std::nullopt : plant_of(*model);
  if (!plant) return std::nullopt;
  return analysis::ModelInUse{fluid, *plant};
}

// The fluid of each run of the request, where it is known; an error if a run is not there.
boost::asio::awaitable<Result<std::vector<std::string>>> fluids_of(JobRoutes parts,
                                                                   std::vector<analysis::RunPart> runs) {
  std::vector<std::string> fluids;
  for (const analysis::RunPart& part : runs) {
    const auto run = co_await parts.runs.find(part.run);
    if (!run) co_return std::unexpected{run.error()};
    fluids.push_back(run->conditions.fluid);
  }
  co_return fluids;
}

// One model is of one fluid; a run without one may be in any.
std::vector<std::string> fluid_doubts(const std::vector<analysis::RunPart>& runs,
                                      const std::vector<std::string>& fluids) {
  std::size_t first = 0;
  for (std::size_t i = 0; i < fluids.size(); ++i) {
    if (fluids[first].empty()) first = i;
    if (fluids[i].empty() || fluids[i] == fluids[first]) continue;
    return {fmt::format("run {} is in the fluid '{}', run {} in '{}': one model can hardly be right for both",
                        runs[first].run, fluids[first], runs[i].run, fluids[i])};
  }
  return {};
}

// A plant to tune for, and where it is from.
struct FoundPlant {
  control::FractionalModel model;
  analysis::OrderedJson source;
  analysis::PlantUncertainty uncertainty = {};
  analysis::ModelDoubts doubts = {};
};

Result<FoundPlant> plant_of_design(const Result<storage::Design>& design) {
  if (!design) return std::unexpected{design.error()};
  if (design->made.kind != storage::DesignKind::model) {
    return fail(ErrorCode::invalid, fmt::format("design {} is a {}; give a model", design->id, text(design->made.kind)),
                "other_kind");
  }
  const json document = json::parse(design->made.document, nullptr, false);
  const auto model = analysis::model_from(document);
  if (!model) return std::unexpected{model.error()};
  const auto uncertainty = analysis::uncertainty_from(document);
  if (!uncertainty) return std::unexpected{uncertainty.error()};
  const auto doubts = analysis::doubts_from(document);
  if (!doubts) return std::unexpected{doubts.error()};
  return FoundPlant{*model, {{"model_id", design->id}}, *uncertainty, *doubts};
}

Result<FoundPlant> plant_of_fluid(const station::FluidModelList& models, const std::string& fluid) {
  const station::FluidModel* in_force = models.find(fluid);
  const auto model = in_force == nullptr ? std::nullopt : plant_of(*in_force);
  if (model) {
    const auto doubts = analysis::doubts_from(json::parse(in_force->document, nullptr, false));
    return FoundPlant{*model, {{"fluid", fluid}}, {}, doubts.value_or(analysis::ModelDoubts{})};
  }
  return fail(ErrorCode::not_found,
              fmt::format("the fluid '{}' has no model with its plant (POST …/fluids/{{fluid}}/model)", fluid),
              "no_model");
}

boost::asio::awaitable<Result<FoundPlant>> find_plant(JobRoutes parts, PlantOfJob asked) {
  if (asked.given) {
    FoundPlant given{*asked.given, {{"given", true}}, asked.given_uncertainty, asked.given_doubts};
    co_return given;
  }
  if (!asked.model) co_return plant_of_fluid(parts.fluid_models.in_force(), asked.fluid);
  const auto design = co_await parts.designs.find(*asked.model);
  co_return plant_of_design(design);
}

std::vector<analysis::FluidPlant> plants_of_fluids(const station::FluidModelList& models) {
  std::vector<analysis::FluidPlant> plants;
  for (const auto& [fluid, model] : models.all()) {
    if (const auto plant = plant_of(model)) plants.push_back({fluid, *plant});
  }
  return plants;
}

using Work = Result<storage::JobWork>;

boost::asio::awaitable<Work> work_of(JobRoutes parts, analysis::IdentifyRequest identify) {
  const auto fluids = co_await fluids_of(parts, identify.runs);
  if (!fluids) co_return std::unexpected{fluids.error()};
  identify.warnings = fluid_doubts(identify.runs, *fluids);
  auto in_use = model_in_use(parts, fluids->front());
  auto work = [&analysis = parts.analysis, identify = std::move(identify), in_use](storage::JobRun& job) {
    return analysis::identify_job(analysis, identify, in_use, job);
  };
  co_return storage::JobWork{std::move(work)};
}

boost::asio::awaitable<Work> work_of(JobRoutes parts, TuneBody body) {
  auto plant = co_await find_plant(parts, body.plant);
  if (!plant) co_return std::unexpected{plant.error()};
  analysis::TuneRequest request = std::move(body.request);
  request.plant = plant->model;
  request.plant_uncertainty = plant->uncertainty;
  request.plant_doubts = plant->doubts;
  request.plant_source = std::move(plant->source);
  request.fluids = plants_of_fluids(parts.fluid_models.in_force());
  auto work = [request = std::move(request)](storage::JobRun& job) { return analysis::tune_job(request, job); };
  co_return storage::JobWork{std::move(work)};
}

boost::asio::awaitable<Work> work_of(JobRoutes parts, TuningMapBody body) {
  auto plant = co_await find_plant(parts, body.plant);
  if (!plant) co_return std::unexpected{plant.error()};
  analysis::TuningMapRequest request = std::move(body.request);
  request.plant = plant->model;
  request.plant_source = std::move(plant->source);
  auto work = [request = std::move(request)](storage::JobRun& job) { return analysis::tuning_map_job(request, job); };
  co_return storage::JobWork{std::move(work)};
}

boost::asio::awaitable<Work> work_of(JobRoutes parts, analysis::MeasuredTuneRequest request) {
  const auto run = co_await parts.runs.find(request.run);
  if (!run) co_return std::unexpected{run.error()};
  auto work = [&analysis = parts.analysis, request = std::move(request)](storage::JobRun& job) {
    return analysis::measured_tune_job(analysis, request, job);
  };
  co_return storage::JobWork{std::move(work)};
}

boost::asio::awaitable<Work> work_of(JobRoutes parts, analysis::DocumentRequest request) {
  for (const storage::RunId id : runs_of(request)) {
    const auto run = co_await parts.runs.find(id);
    if (!run) co_return std::unexpected{run.error()};
  }
  auto work = [documents = parts.documents, request = std::move(request)](storage::JobRun& job) {
    return analysis::document_job(documents, request, job);
  };
  co_return storage::JobWork{std::move(work)};
}

http::Answer begin_job(JobRoutes parts, http::Request request) {
  auto body = parse_job(request.body);
  if (!body) co_return http::problem(body.error());
  auto look_up = std::visit([parts](auto& of) { return work_of(parts, std::move(of)); }, body->request);
  auto work = co_await std::move(look_up);
  if (!work) co_return http::problem(work.error());
  storage::JobRequest wanted{body->kind, body->document, request.actor};
  const auto begun = co_await parts.jobs.begin(std::move(wanted), std::move(*work));
  if (!begun) co_return http::problem(begun.error());
  http::Response response = http::json_response(202, to_json(*begun));
  response.headers.emplace_back("Location", fmt::format("/api/v1/jobs/{}", begun->id));
  co_return response;
}

http::Answer list_jobs(JobRoutes parts, http::Request request) {
  const auto limit = query_limit(request);
  if (!limit) co_return http::problem(limit.error());
  const auto before = query_number_cursor(request, "before");
  if (!before) co_return http::problem(before.error());
  const auto jobs = co_await parts.jobs.list(*before, *limit + 1);
  const auto json_of = [](const storage::Job& job) { return to_json(job); };
  const auto cursor_of = [](const storage::Job& job) { return job.id; };
  co_return http::json_response(200, page_json("jobs", jobs, *limit, json_of, cursor_of));
}

// The result is JSON already, and may be long.
http::Answer get_job(JobRoutes parts, http::Request request) {
  const auto id = job_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto wait_ms = query_number(request, "wait_ms", 0, kMaxWait_ms, 0);
  if (!wait_ms) co_return http::problem(wait_ms.error());
  const microseconds patience{*wait_ms * 1000};
  const auto job = co_await parts.jobs.wait_for(*id, patience);
  if (!job) co_return http::problem(job.error());
  const auto result = co_await parts.jobs.result(*id);
  std::string text = base::dump(to_json(*job));
  text.pop_back();
  text += ",\"result\":" + result.value_or("null") + "}";
  co_return http::json_text_response(200, std::move(text));
}

std::string content_type_of(const std::string& ending) {
  if (ending == "html") return "text/html; charset=utf-8";
  if (ending == "csv") return "text/csv; charset=utf-8";
  if (ending == "mat") return "application/x-matlab-data";
  return ending == "sqlite" ? "application/vnd.sqlite3" : "application/octet-stream";  // and MCAP, as of a run
}

http::Answer get_job_file(JobRoutes parts, http::Request request) {
  const auto id = job_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto job = co_await parts.jobs.find(*id);
  if (!job) co_return http::problem(job.error());
  const auto file = co_await parts.documents.exports.files.find(*id);
  std::unique_ptr<JobFileStream> stream;
  if (file && job->state == storage::JobState::done) {
    stream = co_await JobFileStream::open(parts.documents.exports.exports.reader(), *file);
  }
  if (!stream) {
    co_return http::problem(404,
                            fmt::format("job {}, {} and {}, has no file, or it is no longer kept", *id,
                                        job->request.kind, text(job->state)),
                            "no_file");
  }
  http::Response response;
  response.content_type = content_type_of(file->ending);
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Disposition",
                                fmt::format("attachment; filename=\"job-{}.{}\"", *id, file->ending));
  response.stream = std::move(stream);
  co_return response;
}

http::Answer cancel_job(JobRoutes parts, http::Request request) {
  const auto id = job_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto job = co_await parts.jobs.find(*id);
  if (!job) co_return http::problem(job.error());
  if (job->request.owner != request.actor && !request.caller.scopes.allow(identity::Scope::admin)) {
    co_return http::problem(403,
                            fmt::format("job {} is of {}; its owner or an admin cancels it", *id, job->request.owner),
                            "not_permitted", {{"needs", text(identity::Role::admin)}});
  }
  const auto cancelled = co_await parts.jobs.cancel(*id);
  if (!cancelled) co_return http::problem(cancelled.error());
  co_return http::json_response(200, to_json(*cancelled));
}

}  // namespace

void add_job_routes(http::Router& router, JobRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    std::vector<std::string> query, http::Answer (*answer)(JobRoutes, http::Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  add("POST", "/api/v1/jobs", identity::Scope::record, {}, begin_job);
  add("GET", "/api/v1/jobs", identity::Scope::read, {"before", "limit"}, list_jobs);
  add("GET", "/api/v1/jobs/{job_id}", identity::Scope::read, {"wait_ms"}, get_job);
  add("GET", "/api/v1/jobs/{job_id}/file", identity::Scope::record, {}, get_job_file);
  add("POST", "/api/v1/jobs/{job_id}/cancel", identity::Scope::record, {}, cancel_job);
}

}  // namespace server::api
