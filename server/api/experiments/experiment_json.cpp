#include "server/api/experiments/experiment_json.hpp"

#include <fmt/format.h>

#include "base/json_text.hpp"
#include "server/api/bodies/limits.hpp"
#include "server/experiments/profile_document.hpp"

namespace server::api {
using nlohmann::json;

namespace {

json text_or_null(const std::string& text) { return text.empty() ? json(nullptr) : json(text); }

json time_or_null(const std::optional<std::int64_t>& time) { return time ? json(*time) : json(nullptr); }

json run_json(const storage::ExperimentRun& run) {
  return {{"number", run.number},
          {"state", text(run.state)},
          {"run_id", time_or_null(run.run)},
          {"reason", text_or_null(run.reason)},
          {"variant", json::parse(run.variant, nullptr, false)},
          {"steps", json::parse(run.steps, nullptr, false)},
          {"started_at_us", run.started_at_us},
          {"ended_at_us", time_or_null(run.ended_at_us)},
          {"has_prediction", run.has_prediction},
          {"knowledge", run.knowledge.empty() ? json(nullptr) : json::parse(run.knowledge, nullptr, false)}};
}

json progress_json(const experiments::ExperimentProgress& progress) {
  return {{"run", progress.run},
          {"runs", progress.runs},
          {"step", progress.step},
          {"steps", progress.steps},
          {"elapsed_s", progress.elapsed_s},
          {"duration_s", progress.duration_s},
          {"goes_on_in_s", progress.goes_on_in_s ? json(*progress.goes_on_in_s) : json(nullptr)}};
}

// The document of a profile as it is kept.
Result<std::string> read_profile(const Members& body) {
  if (!body.has("profile")) return fail(ErrorCode::bad_request, "profile is missing", "missing_member");
  const json& profile = body.object().at("profile");
  if (profile.is_object()) {
    std::string document = base::dump(profile);
    if (document.size() <= experiments::kMaxProfileBytes) return document;
    return fail(ErrorCode::invalid, fmt::format("profile has more than {} bytes", experiments::kMaxProfileBytes),
                "out_of_range");
  }
  auto given = body.text("profile", text_bytes("ExperimentBody.profile"));
  if (!given || given->find('\n') != std::string::npos) return given;
  std::string names;
  for (const base::EmbeddedFile& shipped : experiments::shipped_profiles()) {
    if (shipped.name == *given) return std::string{shipped.content};
    names += (names.empty() ? "" : ", ") + std::string{shipped.name};
  }
  return fail(ErrorCode::not_found,
              fmt::format("there is no profile '{}'; there are {}. A document has more than one line",
                          given->substr(0, 40), names),
              "no_such_profile");
}

}  // namespace

json summary_json(const experiments::ExperimentView& view) {
  const storage::Experiment& experiment = view.experiment;
  json out;
  out["experiment_id"] = experiment.id;
  out["robot_id"] = experiment.request.robot_id;
  out["name"] = experiment.request.name;
  out["state"] = text(experiment.state);
  out["reason"] = text_or_null(experiment.reason);
  out["detail"] = text_or_null(experiment.detail);
  out["waits_for"] = text_or_null(view.waits_for);
  out["waits_for_detail"] = text_or_null(view.waits_for_detail);
  out["held"] = experiment.is_held;
  out["priority"] = experiment.request.priority;
  out["unattended"] = experiment.request.is_unattended;
  out["notes"] = experiment.request.notes;
  out["owner"] = experiment.owner;
  out["acts_for"] = experiment.acts_for;
  out["client"] = text_or_null(experiment.client);
  out["runs_planned"] = experiment.runs_planned;
  out["duration_s"] = experiment.duration_s;
  out["created_at_us"] = experiment.created_at_us;
  out["started_at_us"] = time_or_null(experiment.started_at_us);
  out["ended_at_us"] = time_or_null(experiment.ended_at_us);
  out["run_counts"] = json::object();
  for (const auto& [state, count] : experiment.run_counts) out["run_counts"][text(state)] = count;
  out["progress"] = view.progress ? progress_json(*view.progress) : json(nullptr);
  out["activity"] = text_or_null(view.activity);
  return out;
}

json to_json(const experiments::ExperimentView& view) {
  json out = summary_json(view);
  out["runs"] = json::array();
  for (const storage::ExperimentRun& run : view.experiment.runs) out["runs"].push_back(run_json(run));
  return out;
}

Result<storage::ExperimentRequest> parse_experiment(const std::string& text) {
  const auto body = Members::parse(text, {"robot_id", "profile", "priority", "unattended", "notes"});
  if (!body) return std::unexpected{body.error()};
  storage::ExperimentRequest request;
  const auto robot_id = body->text("robot_id", {0, kMaxWordBytes});
  if (!robot_id) return std::unexpected{robot_id.error()};
  request.robot_id = *robot_id;
  auto profile = read_profile(*body);
  if (!profile) return std::unexpected{profile.error()};
  request.profile = std::move(*profile);
  if (body->has("priority")) {
    const auto priority = body->integer("priority", integers("ExperimentBody.priority"));
    if (!priority) return std::unexpected{priority.error()};
    request.priority = *priority;
  }
  const auto unattended = body->flag("unattended");
  if (!unattended) return std::unexpected{unattended.error()};
  request.is_unattended = *unattended;
  if (body->has("notes")) {
    auto notes = body->text("notes", text_bytes("ExperimentBody.notes"));
    if (!notes) return std::unexpected{notes.error()};
    request.notes = std::move(*notes);
  }
  return request;
}

Result<std::string> parse_abort(const std::string& text) {
  if (text.empty()) return std::string{};
  const auto body = Members::parse(text, {"reason"});
  if (!body) return std::unexpected{body.error()};
  if (!body->has("reason")) return std::string{};
  return body->text("reason", text_bytes("ExperimentAbortBody.reason"));
}

Result<std::optional<std::int64_t>> parse_keep_alive(const std::string& text) {
  std::optional<std::int64_t> stamp_us;
  if (text.empty()) return stamp_us;
  const auto body = Members::parse(text, {"stamp_us"});
  if (!body) return std::unexpected{body.error()};
  if (auto read = body->time("stamp_us", stamp_us); !read) return std::unexpected{read.error()};
  return stamp_us;
}

Result<MoveBody> parse_move(const std::string& text) {
  const auto body = Members::parse(text, {"before", "priority"});
  if (!body) return std::unexpected{body.error()};
  MoveBody move;
  if (body->has("before")) {
    const auto before = body->integer("before", integers("ExperimentMoveBody.before"));
    if (!before) return std::unexpected{before.error()};
    move.before = *before;
  }
  if (body->has("priority")) {
    const auto priority = body->integer("priority", integers("ExperimentMoveBody.priority"));
    if (!priority) return std::unexpected{priority.error()};
    move.priority = *priority;
  }
  return move;
}

}  // namespace server::api
