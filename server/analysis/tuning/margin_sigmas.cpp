// At the crossover that was achieved.
#include "server/analysis/tuning/margin_sigmas.hpp"

namespace server::analysis {

std::optional<control::MarginUncertainty> margin_sigmas(const control::FractionalModel& plant,
                                                        const control::TuningResult& result,
                                                        const PlantUncertainty& of_plant) {
  if (!result.tuned || !of_plant || !result.tuned->achieved.gain_crossover_rad_s) return std::nullopt;
  const control::TunedController& tuned = *result.tuned;
  const control::OpenLoop loop{plant, tuned.controller, tuned.spec.is_velocity_loop};
  return control::margin_uncertainty(loop, *tuned.achieved.gain_crossover_rad_s, *of_plant);
}

void add_margin_sigmas(const control::FractionalModel& plant, const control::TuningResult& result,
                       const PlantUncertainty& of_plant, OrderedJson& answer) {
  if (!result.tuned) return;
  const auto sigmas = margin_sigmas(plant, result, of_plant);
  OrderedJson& achieved = answer["achieved"];
  achieved["phase_margin_sigma_deg"] = sigmas ? OrderedJson(sigmas->phase_margin_deg) : OrderedJson{};
  achieved["crossover_sigma_rad_s"] = sigmas ? OrderedJson(sigmas->gain_crossover_rad_s) : OrderedJson{};
  achieved["phase_slope_sigma_deg_per_rad_s"] = sigmas ? OrderedJson(sigmas->phase_slope_deg_per_rad_s) : OrderedJson{};
}

void add_plant_doubts(const ModelDoubts& known, OrderedJson& answer) {
  answer["plant_doubts"] = known.are_known ? json_of(std::span{known.doubts}) : OrderedJson{};
  answer["plant_doubts_text"] = doubts_in_words(known);
}

}  // namespace server::analysis
