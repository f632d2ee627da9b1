// Members in the order in which a person reads them.
#include "server/analysis/tuning/tuning_json.hpp"

#include "server/analysis/optional_json.hpp"

namespace server::analysis {
namespace {

OrderedJson ends_of(std::span<const control::PhaseMarginRange> ranges) {
  if (ranges.empty()) return nullptr;
  OrderedJson ends = OrderedJson::array();
  for (const auto& range : ranges) ends.insert(ends.end(), {range.low_deg, range.high_deg});
  return ends;
}

OrderedJson point_json(const control::TuningMapPoint& point) {
  const bool is_empty = point.ranges.empty();
  OrderedJson out{{"crossover_rad_s", point.gain_crossover_rad_s},
                  {"lowest_phase_margin_deg", is_empty ? OrderedJson{} : OrderedJson(point.ranges.front().low_deg)},
                  {"highest_phase_margin_deg", is_empty ? OrderedJson{} : OrderedJson(point.ranges.back().high_deg)},
                  {"reason", text(point.reason)},
                  {"phase_fall", point.phase_fall},
                  {"ranges_deg", OrderedJson::array()}};
  for (const auto& range : point.ranges) out["ranges_deg"].push_back({range.low_deg, range.high_deg});
  return out;
}

}  // namespace

OrderedJson tuning_json(const control::FractionalModel& plant, const control::TuningSpec& spec,
                        const control::TuningResult& result, std::span<const control::PhaseMarginRange> sound_margins) {
  OrderedJson answer = json_of(result);
  answer["feasible_phase_margins_deg"] = ends_of(sound_margins);
  answer["asked"] = {{"crossover_rad_s", spec.gain_crossover_rad_s},
                     {"phase_margin_deg", spec.phase_margin_deg},
                     {"mu", or_null(spec.mu)},
                     {"velocity_loop", spec.is_velocity_loop},
                     {"period_s", spec.period_s}};
  answer["plant"] = json_of(plant);
  return answer;
}

const char* text(control::MapReason value) {
  switch (value) {
    case control::MapReason::feasible: return "feasible";
    case control::MapReason::phase_falls_too_fast: return "phase_falls_too_fast";
    case control::MapReason::margin_below_0: return "margin_below_0";
    case control::MapReason::margin_above_180: return "margin_above_180";
    case control::MapReason::not_sound: return "not_sound";
  }
  return "";
}

OrderedJson tuning_map_json(const control::FractionalModel& plant, const control::TuningMapSpec& spec,
                            std::span<const control::TuningMapPoint> map) {
  OrderedJson out{{"points", OrderedJson::array()}};
  for (const control::TuningMapPoint& point : map) out["points"].push_back(point_json(point));
  out["asked"] = {{"from_rad_s", spec.from_rad_s},
                  {"to_rad_s", spec.to_rad_s},
                  {"points", spec.points},
                  {"velocity_loop", spec.is_velocity_loop},
                  {"period_s", spec.period_s}};
  out["plant"] = json_of(plant);
  return out;
}

OrderedJson predicted_json(const FluidPlant& in, const control::Discretisation& controller, double duty_min,
                           double duty_max) {
  control::ClosedLoopExperiment experiment;
  experiment.plant = in.plant;
  experiment.controller = controller.sections;
  experiment.period_s = controller.options.period_s;
  experiment.duty_min = duty_min;
  experiment.duty_max = duty_max;
  const control::ClosedLoopPrediction predicted = control::predict_closed_loop(experiment);
  return {{"fluid", in.fluid.empty() ? OrderedJson{} : OrderedJson(in.fluid)},
          {"step", json_of(predicted.step)},
          {"disturbance", json_of(predicted.disturbance)},
          {"clipped_fraction", predicted.clipped_fraction},
          {"is_diverging", predicted.is_diverging},
          {"experiment",
           {{"setpoint_m", experiment.setpoint_m},
            {"disturbance_m", experiment.disturbance_m},
            {"disturbance_at_s", experiment.disturbance_at_s},
            {"duration_s", experiment.duration_s},
            {"duty_min", duty_min},
            {"duty_max", duty_max}}},
          {"plant", json_of(in.plant)}};
}

}  // namespace server::analysis
