// Reads, fits, tries on other data.
#include "server/analysis/identify_job.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/analysis/identification_answer.hpp"
#include "server/analysis/search/search_progress.hpp"

namespace server::analysis {
namespace asio = boost::asio;

namespace {

// What was read of a run, and which piece of it is wanted.
struct ReadRun {
  RunPart part;
  RunSamples samples;
};

Result<RunOfMany> recording_in(const ReadRun& read, ChannelChoice channels) {
  auto recording = recording_of(read.samples, read.part.window, channels);
  if (recording) return RunOfMany{read.part.run, std::move(*recording)};
  Error error = recording.error();
  error.detail = fmt::format("run {}: {}", read.part.run, error.detail);
  return std::unexpected{std::move(error)};
}

OrderedJson quality_json(const control::Fit& fit) {
  return {{"fit_percent", fit.fit_percent},
          {"residual_sd", fit.residual_sd},
          {"residuals_are_white", fit.residuals_are_white},
          {"whiteness_p_value", fit.whiteness_p_value}};
}

// The refusal of a search that has reached its limit, also of the search for the sensor of data on which a model is
// tried.
Error out_of_time(double time_limit_s) {
  return {
      ErrorCode::conflict,
      fmt::format("the search reached its time limit, {:g} s, so there is no model: raise the limit (rheonaut identify "
                  "--time-limit-s; time_limit_s of a job, at most 600), or search for one structure, for no dead "
                  "time (--dead-time-s 0; dead_time_s 0 of a job), or in a shorter part of the run",
                  time_limit_s),
      {}};
}

using DeadZone = std::optional<control::DeadZone>;  // that the fit has found; on other data it is the motor's, too

// The quality of a model on other data; the error: its time ran out.
Result<OrderedJson> quality_on(const RunOfMany& run, const control::FractionalModel& model,
                               const IdentifyRequest& request, const DeadZone& zone) {
  control::Recording recording = run.recorded.recording;
  if (zone) recording.duty = control::beyond_dead_zone(std::move(recording.duty), *zone);
  const control::Fit fit = control::evaluate(model, recording, request.search);
  if (is_out_of_time(fit)) return std::unexpected{out_of_time(request.search.time_limit_s)};
  return quality_json(fit);
}

Result<OrderedJson> validation_json(const RunOfMany& run, const control::FractionalModel& model,
                                    const IdentifyRequest& request, const DeadZone& zone) {
  auto answer = quality_on(run, model, request, zone);
  if (!answer) return answer;
  (*answer)["run_id"] = run.run;
  (*answer)["channels"] = channels_of(run.recorded.recording);
  return answer;
}

// On one run as it always was; on several, one quality for each.
Result<OrderedJson> in_use_json(std::span<const RunOfMany> runs, const ModelInUse& in_use,
                                const IdentifyRequest& request, const DeadZone& zone) {
  OrderedJson answer;
  if (runs.size() == 1) {
    auto quality = quality_on(runs.front(), in_use.model, request, zone);
    if (!quality) return quality;
    answer = std::move(*quality);
  } else {
    answer["runs"] = OrderedJson::array();
    for (const RunOfMany& run : runs) {
      auto quality = validation_json(run, in_use.model, request, zone);
      if (!quality) return quality;
      answer["runs"].push_back(std::move(*quality));
    }
  }
  answer["fluid"] = in_use.fluid;
  answer["parameters"] = json_of(in_use.model);
  return answer;
}

OrderedJson found_json(std::span<const RunOfMany> runs, control::Identification found, const IdentifyRequest& request) {
  std::vector<std::string>& warnings = found.warnings;
  warnings.insert(warnings.end(), request.warnings.begin(), request.warnings.end());
  if (runs.size() > 1) return answer_json(runs, found, request.with_residuals);
  OrderedJson answer = answer_json(runs.front().recorded, found, request.with_residuals);
  answer["run_id"] = runs.front().run;
  return answer;
}

// The numbers, and the model that is sent to robots now on the same recordings.
Result<std::string> compute(std::span<const RunOfMany> runs, const RunOfMany* validation, IdentifyRequest request,
                            const std::optional<ModelInUse>& in_use, storage::JobRun& run) {
  control::IdentificationOptions& search = request.search;
  SearchShare share{search.structure.has_value()};
  search.on_progress = [&run, &share](const control::Progress& progress) {
    run.report(share.at(progress), in_words(progress));
    return !run.is_cancelled();
  };
  run.report(0, "searching");
  control::Identification found =
      runs.size() == 1 ? identify_run(runs.front().recorded, search) : identify_runs(runs, search);
  if (run.is_cancelled()) return fail(ErrorCode::conflict, "cancelled");
  if (is_out_of_time(found.best)) return std::unexpected{out_of_time(search.time_limit_s)};
  search.on_progress = [&run](const control::Progress&) { return !run.is_cancelled(); };
  run.report(1, "trying the model on other data");
  const bool has_model = std::isfinite(found.best.sse);
  const control::FractionalModel model = found.best.model;
  const DeadZone zone = found.dead_zone;
  OrderedJson answer = found_json(runs, std::move(found), request);
  Result<OrderedJson> others = OrderedJson{}, of_in_use = OrderedJson{};
  if (validation != nullptr && has_model) others = validation_json(*validation, model, request, zone);
  if (in_use && others) of_in_use = in_use_json(runs, *in_use, request, zone);
  for (const auto* tried : {&others, &of_in_use}) {
    if (!*tried) return std::unexpected{tried->error()};
  }
  answer["validation"] = std::move(*others);
  answer["model_in_use"] = std::move(*of_in_use);
  return answer.dump();
}

Result<std::string> work_on(const std::vector<ReadRun>& read, const std::optional<ReadRun>& others,
                            const IdentifyRequest& request, const std::optional<ModelInUse>& in_use,
                            storage::JobRun& run) {
  std::vector<RunOfMany> runs;
  for (const ReadRun& one : read) {
    auto recording = recording_in(one, request.channels);
    if (!recording) return std::unexpected{recording.error()};
    runs.push_back(std::move(*recording));
  }
  Result<RunOfMany> validation = RunOfMany{};
  if (others) validation = recording_in(*others, request.channels);
  if (!validation) return std::unexpected{validation.error()};
  return compute(runs, others ? &*validation : nullptr, request, in_use, run);
}

}  // namespace

asio::awaitable<Result<std::string>> identify_job(AnalysisService& analysis, IdentifyRequest request,
                                                  std::optional<ModelInUse> in_use, storage::JobRun& run) {
  std::vector<ReadRun> read;
  for (const RunPart& part : request.runs) {
    run.report(0, fmt::format("reading run {}", part.run));
    auto samples = co_await analysis.samples(part.run, control::kMostSamples);
    if (!samples) co_return std::unexpected{samples.error()};
    read.push_back({part, std::move(*samples)});
  }
  std::optional<ReadRun> others;
  if (request.validation) {
    auto samples = co_await analysis.samples(request.validation->run, control::kMostSamples);
    if (!samples) co_return std::unexpected{samples.error()};
    others = ReadRun{*request.validation, std::move(*samples)};
  }
  auto work = [read = std::move(read), others = std::move(others), request = std::move(request),
               in_use = std::move(in_use), &run] { return work_on(read, others, request, in_use, run); };
  co_return co_await run.compute(std::move(work));
}

}  // namespace server::analysis
