// At the crossover that was achieved.
#include "server/analysis/tuning/margin_sigmas.hpp"

namespace server::analysis {

std::optional<control::MarginUncertainty> margin_sigmas(const control::OpenLoop& loop, const control::Margins& margins,
                                                        const PlantUncertainty& of_plant) {
  if (!of_plant || !margins.gain_crossover_rad_s) return std::nullopt;
  return control::margin_uncertainty(loop, *margins.gain_crossover_rad_s, *of_plant);
}

std::optional<control::MarginUncertainty> margin_sigmas(const control::FractionalModel& plant,
                                                        const control::TuningResult& result,
                                                        const PlantUncertainty& of_plant) {
  if (!result.tuned) return std::nullopt;
  const control::TunedController& tuned = *result.tuned;
  return margin_sigmas({plant, tuned.controller, tuned.spec.is_velocity_loop}, tuned.achieved, of_plant);
}

void add_margin_sigmas(const std::optional<control::MarginUncertainty>& sigmas, OrderedJson& margins) {
  margins["phase_margin_sigma_deg"] = sigmas ? OrderedJson(sigmas->phase_margin_deg) : OrderedJson{};
  margins["crossover_sigma_rad_s"] = sigmas ? OrderedJson(sigmas->gain_crossover_rad_s) : OrderedJson{};
  margins["phase_slope_sigma_deg_per_rad_s"] = sigmas ? OrderedJson(sigmas->phase_slope_deg_per_rad_s) : OrderedJson{};
}

void add_margin_sigmas(const control::FractionalModel& plant, const control::TuningResult& result,
                       const PlantUncertainty& of_plant, OrderedJson& answer) {
  if (result.tuned) add_margin_sigmas(margin_sigmas(plant, result, of_plant), answer["achieved"]);
}

void add_plant_doubts(const ModelDoubts& known, OrderedJson& answer) {
  answer["plant_doubts"] = known.are_known ? json_of(std::span{known.doubts}) : OrderedJson{};
  answer["plant_doubts_text"] = doubts_in_words(known);
}

}  // namespace server::analysis
