// Jobs: begin, list, watch, take the result, cancel.
#include <fmt/format.h>

#include "base/json_text.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/identify_job.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/bodies/job_body.hpp"
#include "server/api/bodies/query_params.hpp"
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

// The model that robots in the fluid are sent, where its document says which plant it is of.
std::optional<analysis::ModelInUse> model_in_use(JobRoutes parts, const std::string& fluid) {
  const station::FluidModel* model = parts.fluid_models.in_force().find(fluid);
  if (model == nullptr) return std::nullopt;
  const json document = json::parse(model->document, nullptr, false);
  if (!document.is_object() || !document.contains("plant")) return std::nullopt;
  const auto plant = analysis::model_from(document.at("plant"));
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

http::Answer begin_job(JobRoutes parts, http::Request request) {
  auto body = parse_job(request.body);
  if (!body) co_return http::problem(body.error());
  const auto fluids = co_await fluids_of(parts, body->identify.runs);
  if (!fluids) co_return http::problem(fluids.error());
  body->identify.warnings = fluid_doubts(body->identify.runs, *fluids);
  auto in_use = model_in_use(parts, fluids->front());
  auto work = [&analysis = parts.analysis, identify = body->identify, in_use](storage::JobRun& job) {
    return analysis::identify_job(analysis, identify, in_use, job);
  };
  storage::JobRequest wanted{body->kind, body->document, request.actor};
  const auto begun = co_await parts.jobs.begin(std::move(wanted), std::move(work));
  if (!begun) co_return http::problem(begun.error());
  http::Response response = http::json_response(202, to_json(*begun));
  response.headers.emplace_back("Location", fmt::format("/api/v1/jobs/{}", begun->id));
  co_return response;
}

http::Answer list_jobs(JobRoutes parts, http::Request request) {
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) co_return http::problem(limit.error());
  const auto before = query_number(request, "before", 1, kMaxRunId, 0);
  if (!before) co_return http::problem(before.error());
  const auto jobs = co_await parts.jobs.list(*before, static_cast<std::size_t>(*limit));
  json list = json::array();
  for (const storage::Job& job : jobs) list.push_back(to_json(job));
  co_return http::json_response(200, {{"jobs", std::move(list)}});
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

http::Answer cancel_job(JobRoutes parts, http::Request request) {
  const auto id = job_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto job = co_await parts.jobs.find(*id);
  if (!job) co_return http::problem(job.error());
  if (job->request.owner != request.actor && !request.caller.scopes.allow(identity::Scope::admin)) {
    co_return http::problem(403,
                            fmt::format("job {} is of {}; its owner or an admin cancels it", *id, job->request.owner),
                            "not_permitted");
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
  add("POST", "/api/v1/jobs/{job_id}/cancel", identity::Scope::record, {}, cancel_job);
}

}  // namespace server::api
