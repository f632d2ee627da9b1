// Reads, measures, tunes, discretises.
#include "server/analysis/tuning/measured_tune_job.hpp"

#include <fmt/format.h>

#include "control/responses/frequency_response.hpp"
#include "control/tuning/measured_tuning.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/optional_json.hpp"
#include "server/analysis/tuning/controller_document.hpp"

namespace server::analysis {
namespace asio = boost::asio;

namespace {

constexpr double kBeginning_s = 5;

OrderedJson measured_json(const control::MeasuredPlant& plant) {
  OrderedJson out{{"points", OrderedJson::array()}};
  for (const control::MeasuredPoint& point : plant.points) {
    out["points"].push_back({{"omega_rad_s", point.omega_rad_s},
                             {"modulus", point.modulus},
                             {"phase_deg", point.phase_rad * control::kDegPerRad},
                             {"sigma", point.sigma},
                             {"duty", point.duty},
                             {"acceleration_m_s2", point.acceleration}});
  }
  out["phase_fall"] = plant.phase_fall;
  out["phase_fall_sigma"] = plant.phase_fall_sigma;
  out["used_s"] = plant.used_s;
  return out;
}

void add_controller(const MeasuredTuneRequest& request, const control::MeasuredTuning& tuned, OrderedJson& answer) {
  const control::FopdController& controller = *tuned.controller;
  answer["kp"] = controller.kp;
  answer["kd"] = controller.kd;
  answer["mu"] = controller.mu;
  const std::string remark = control::remark_on(controller, request.spec.gain_crossover_rad_s);
  if (!remark.empty()) answer["warnings"].push_back(remark);
  answer["achieved"] = {{"phase_margin_sigma_deg", tuned.phase_margin_sigma_deg},
                        {"crossover_sigma_rad_s", tuned.crossover_sigma_rad_s},
                        {"phase_slope_sigma_deg_per_rad_s", tuned.phase_slope_sigma_deg_per_rad_s}};
  const bool is_one_way = request.duty_min.value_or(-1) >= 0;
  answer["discretised"] = discretised_json(discretised(controller, sampling_for(request.period_s, is_one_way)));
  if (request.duty_min) answer["discretised"]["duty_min"] = *request.duty_min;
  if (request.duty_max) answer["discretised"]["duty_max"] = *request.duty_max;
}

OrderedJson offers_json(const std::vector<control::MeasuredOffer>& offers) {
  OrderedJson out = OrderedJson::array();
  for (const auto& [name, spec, controller] : offers) {
    OrderedJson offer{
        {"name", name}, {"crossover_rad_s", spec.gain_crossover_rad_s}, {"phase_margin_deg", spec.phase_margin_deg}};
    offer.update(json_of(controller));
    out.push_back(std::move(offer));
  }
  return out;
}

Result<std::string> compute(const RunSamples& samples, const MeasuredTuneRequest& request, storage::JobRun& run) {
  const auto recorded = recording_of(samples, request.window, ChannelChoice::robot);
  if (!recorded) return std::unexpected{recorded.error()};
  const control::Recording& recording = recorded->recording;
  if (recording.acceleration_m_s2.empty()) {
    return fail(ErrorCode::invalid,
                fmt::format("the position of run {} was measured: find a model with the job identify", request.run),
                "no_acceleration");
  }
  if (!recording.is_left_out.empty()) {
    return fail(
        ErrorCode::invalid,
        fmt::format("run {} was interrupted, and tones are measured in one piece: repeat the run, or choose a part "
                    "of it without an interruption. {}",
                    request.run, recorded->warnings.front()),
        "interrupted");
  }
  run.report(0.3, "measuring the tones");
  const control::ToneRecord record{recording.duty, recording.acceleration_m_s2, recording.dt_s, kBeginning_s};
  const auto plant = control::measure_three_tones(record, request.spec.gain_crossover_rad_s);
  control::MeasuredTuning tuned;
  tuned.reason = plant.refusal;
  if (plant.refusal.empty()) tuned = control::tune_measured(plant, request.spec);
  OrderedJson answer{{"feasible", tuned.controller.has_value()},
                     {"reason", tuned.controller ? OrderedJson{} : OrderedJson(tuned.reason)},
                     {"run_id", request.run},
                     {"measured", plant.refusal.empty() ? measured_json(plant) : OrderedJson{}},
                     {"asked",
                      {{"crossover_rad_s", request.spec.gain_crossover_rad_s},
                       {"phase_margin_deg", request.spec.phase_margin_deg},
                       {"mu", or_null(request.spec.mu)}}},
                     {"warnings", recorded->warnings},
                     {"nearest_all", offers_json(tuned.nearest)},
                     {"relaxed", offers_json(tuned.relaxed)}};
  run.report(0.6, "discretising");
  if (tuned.controller) add_controller(request, tuned, answer);
  return answer.dump();
}

}  // namespace

asio::awaitable<Result<std::string>> measured_tune_job(AnalysisService& analysis, MeasuredTuneRequest request,
                                                       storage::JobRun& run) {
  run.report(0, fmt::format("reading run {}", request.run));
  auto samples = co_await analysis.samples(request.run, control::kMostSamples);
  if (!samples) co_return std::unexpected{samples.error()};
  auto work = [samples = std::move(*samples), request = std::move(request), &run] {
    return compute(samples, request, run);
  };
  co_return co_await run.compute(std::move(work));
}

}  // namespace server::analysis
