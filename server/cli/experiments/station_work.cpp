// Looks again until the work has ended.
#include "server/cli/experiments/station_work.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace server::cli {

using nlohmann::json;

namespace {

constexpr int kFirstProblem = 300, kTakenOver = 409;
constexpr std::string_view kEndedExperiment[] = {"done", "aborted", "cancelled", "interrupted"};

bool has_ended(const json& experiment) {
  const auto state = experiment.at("state").get<std::string>();
  return std::ranges::find(kEndedExperiment, state) != std::end(kEndedExperiment);
}

json body_of(StationAnswer answer) {
  if (answer.status < kFirstProblem) return std::move(answer.body);
  const json& problem = answer.body;
  const std::string why = problem.is_object() ? problem.value("detail", std::string{}) : std::string{};
  throw std::runtime_error{
      fmt::format("the station refused: {}", why.empty() ? fmt::format("status {}", answer.status) : why)};
}

}  // namespace

json StationWork::checked(const std::string& method, const std::string& target, const json& body) const {
  return body_of(ask_(method, target, body));
}

// None: the station was busy.
std::optional<json> StationWork::look_at(const std::string& target, BusyWait& busy) const {
  StationAnswer answer = ask_("GET", fmt::format("{}?wait_ms={}", target, kLookMs), nullptr);
  if (busy.asks_again(answer)) return std::nullopt;
  return body_of(std::move(answer));
}

json StationWork::finished_job(std::int64_t job_id) const {
  BusyWait busy{busy_rule_, fmt::format("rheonaut job show {0} --wait waits for job {0} again", job_id)};
  for (;;) {
    std::optional<json> job = look_at(fmt::format("/api/v1/jobs/{}", job_id), busy);
    if (!job) continue;
    on_look_(*job);
    if (!job->at("ended_at_us").is_null()) return std::move(*job);
  }
}

void StationWork::resume_what_was_left(std::int64_t experiment_id) const {
  const std::string target = fmt::format("/api/v1/experiments/{}", experiment_id);
  const json now = get(target);
  const json reason = now.value("reason", json());
  const bool was_left = now.value("held", false) && (reason == "nobody_present" || reason == "station_restarted");
  if (now.at("state") == "waiting" && was_left) post(target + "/resume", json::object());
}

json StationWork::finished_experiment(std::int64_t experiment_id) const {
  const std::string target = fmt::format("/api/v1/experiments/{}", experiment_id);
  json seen = json::object();  // SAFETY: a sign of life is as old as what this tool has seen of the station
  BusyWait busy{busy_rule_, fmt::format("rheonaut experiment show {} says what has become of it", experiment_id)};
  for (;;) {
    // Refused for one that has just ended, which the next look shows.
    const StationAnswer kept = ask_("POST", target + "/keep-alive", seen);
    if (kept.status == 200 && kept.body.contains("stamp_us")) seen["stamp_us"] = kept.body.at("stamp_us");
    const bool is_of_others = kept.status == kTakenOver && kept.body.value("reason", "") == "acts_for_another";
    std::optional<json> experiment = look_at(target, busy);
    if (!experiment) continue;
    on_look_(*experiment);
    if (has_ended(*experiment)) return std::move(*experiment);
    // An experiment that waits in other hands may never begin; one that runs there ends by itself.
    if (is_of_others && experiment->at("state") == "waiting") throw std::runtime_error{kept.body.value("detail", "")};
  }
}

}  // namespace server::cli
