// Tunes, discretises, predicts.
#include "server/analysis/tuning/tune_job.hpp"

#include <fmt/format.h>

#include "control/tuning/tuning_alternatives.hpp"
#include "server/analysis/tuning/controller_document.hpp"

namespace server::analysis {
namespace asio = boost::asio;

namespace {

// A controller that is found: what the robot runs, and what becomes of the loop.
void add_controller(const TuneRequest& request, const control::FopdController& controller, storage::JobRun& run,
                    OrderedJson& answer) {
  run.report(0.2, "discretising");
  const double duty_min = request.duty_min.value_or(-1), duty_max = request.duty_max.value_or(1);
  const bool is_one_way = duty_min >= 0;
  const auto choice = discretised(controller, sampling_for(request.period_s, is_one_way));
  answer["discretised"] = discretised_json(choice);
  if (request.duty_min) answer["discretised"]["duty_min"] = duty_min;
  if (request.duty_max) answer["discretised"]["duty_max"] = duty_max;
  run.report(0.4, "predicting");
  answer["robustness"] = json_of(control::robustness(request.plant, choice.chosen));
  answer["predicted"] = OrderedJson::array({predicted_json({"", request.plant}, choice.chosen, duty_min, duty_max)});
  for (const FluidPlant& in : request.fluids) {
    if (run.is_cancelled()) return;
    answer["predicted"].push_back(predicted_json(in, choice.chosen, duty_min, duty_max));
  }
}

std::string compute_tuning(const TuneRequest& request, storage::JobRun& run) {
  run.report(0, "tuning");
  control::TuningSpec spec = request.spec;
  spec.period_s = request.period_s;
  const control::TuningResult result = control::tune(request.plant, spec);
  OrderedJson answer = tuning_json(request.plant, spec, result, control::sound_phase_margins(request.plant, spec));
  add_margin_sigmas(request.plant, result, request.plant_uncertainty, answer);
  add_plant_doubts(request.plant_doubts, answer);
  answer["plant_source"] = request.plant_source;
  if (result.tuned) add_controller(request, result.tuned->controller, run, answer);
  return answer.dump();
}

std::string compute_map(const TuningMapRequest& request, storage::JobRun& run) {
  const auto goes_on = [&run](double share) {
    run.report(share, "looking for sound designs");
    return !run.is_cancelled();
  };
  control::TuningMapSpec spec = request.spec;
  spec.period_s = Sampling{}.period_s;
  OrderedJson answer = tuning_map_json(request.plant, spec, control::tuning_map(request.plant, spec, goes_on));
  answer["plant_source"] = request.plant_source;
  return answer.dump();
}

}  // namespace

asio::awaitable<Result<std::string>> tune_job(TuneRequest request, storage::JobRun& run) {
  auto work = [request = std::move(request), &run]() -> Result<std::string> { return compute_tuning(request, run); };
  co_return co_await run.compute(std::move(work));
}

asio::awaitable<Result<std::string>> tuning_map_job(TuningMapRequest request, storage::JobRun& run) {
  auto work = [request = std::move(request), &run]() -> Result<std::string> { return compute_map(request, run); };
  co_return co_await run.compute(std::move(work));
}

}  // namespace server::analysis
