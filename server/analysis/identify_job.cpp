// Reads, fits, tries on other data.
#include "server/analysis/identify_job.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/analysis/identification_answer.hpp"

namespace server::analysis {
namespace asio = boost::asio;

namespace {

// What a run gives to a fit, or why it gives nothing.
using Readable = Result<RunRecording>;

Readable recording_in(const RunSamples& samples, storage::RunId run, const RunWindow& window, ChannelChoice channels) {
  const storage::StoredReference* reference = samples.reference ? &*samples.reference : nullptr;
  auto recording = recording_of(samples.samples, window, reference, channels);
  if (recording) return recording;
  Error error = recording.error();
  error.detail = fmt::format("run {}: {}", run, error.detail);
  return std::unexpected{std::move(error)};
}

// Of the whole search, from what one start says.
double share_of(const control::Progress& progress, const control::IdentificationOptions& options) {
  const int structures = options.structure ? 1 : 3;
  int index = 0;
  if (!options.structure) {
    index = progress.structure == control::Structure::first_order    ? 0
            : progress.structure == control::Structure::second_order ? 1
                                                                     : 2;
  }
  const double within = static_cast<double>(progress.start) / std::max(progress.starts, 1);
  return (index + within) / structures;
}

OrderedJson quality_json(const control::Fit& fit) {
  return {{"fit_percent", fit.fit_percent},
          {"residual_sd", fit.residual_sd},
          {"residuals_are_white", fit.residuals_are_white},
          {"whiteness_p_value", fit.whiteness_p_value}};
}

OrderedJson validation_json(const RunRecording& recorded, const control::FractionalModel& model,
                            const IdentifyRequest& request) {
  OrderedJson answer = quality_json(control::evaluate(model, recorded.recording, request.search));
  answer["run_id"] = *request.validation_run;
  answer["channels"] = channels_of(recorded.recording);
  return answer;
}

// The numbers, and the model that is sent to robots now on the same recording.
Result<std::string> compute(const RunRecording& recorded, const RunRecording* validation, IdentifyRequest request,
                            const std::optional<ModelInUse>& in_use, storage::JobRun& run) {
  control::IdentificationOptions& search = request.search;
  search.on_progress = [&run, &search](const control::Progress& progress) {
    run.report(share_of(progress, search), fmt::format("{}: start {} of {}, iteration {}", text(progress.structure),
                                                       progress.start + 1, progress.starts, progress.iteration));
    return !run.is_cancelled();
  };
  run.report(0, "searching");
  const control::Identification found = identify_run(recorded, search);
  if (run.is_cancelled()) return fail(ErrorCode::conflict, "cancelled");
  run.report(1, "trying the model on other data");
  OrderedJson answer = answer_json(recorded, found, request.with_residuals);
  answer["run_id"] = request.run;
  const bool has_model = std::isfinite(found.best.sse);
  answer["validation"] =
      validation != nullptr && has_model ? validation_json(*validation, found.best.model, request) : OrderedJson{};
  answer["model_in_use"] = nullptr;
  if (in_use) {
    answer["model_in_use"] = quality_json(control::evaluate(in_use->model, recorded.recording, search));
    answer["model_in_use"]["fluid"] = in_use->fluid;
    answer["model_in_use"]["parameters"] = json_of(in_use->model);
  }
  return answer.dump();
}

}  // namespace

asio::awaitable<Result<std::string>> identify_job(AnalysisService& analysis, IdentifyRequest request,
                                                  std::optional<ModelInUse> in_use, storage::JobRun& run) {
  run.report(0, fmt::format("reading run {}", request.run));
  auto samples = co_await analysis.samples(request.run, control::kMostSamples);
  if (!samples) co_return std::unexpected{samples.error()};
  std::optional<RunSamples> others;
  if (request.validation_run) {
    auto read = co_await analysis.samples(*request.validation_run, control::kMostSamples);
    if (!read) co_return std::unexpected{read.error()};
    others = std::move(*read);
  }
  auto work = [samples = std::move(*samples), others = std::move(others), request = std::move(request),
               in_use = std::move(in_use), &run]() -> Result<std::string> {
    const auto recorded = recording_in(samples, request.run, request.window, request.channels);
    if (!recorded) return std::unexpected{recorded.error()};
    Readable validation = RunRecording{};
    if (others) {
      validation = recording_in(*others, *request.validation_run, request.validation_window, request.channels);
      if (!validation) return std::unexpected{validation.error()};
    }
    return compute(*recorded, others ? &*validation : nullptr, request, in_use, run);
  };
  co_return co_await run.compute(std::move(work));
}

}  // namespace server::analysis
