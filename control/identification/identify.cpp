// Checks the recording, fits the structures asked for, compares them and words the doubts.
#include "control/identification/identify.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "control/evidence/score_doubts.hpp"
#include "control/identification/fit_summary.hpp"
#include "control/identification/further_search.hpp"
#include "control/identification/identifiability.hpp"
#include "control/identification/recording_checks.hpp"
#include "control/identification/residual_doubts.hpp"
#include "control/identification/second_opinions.hpp"
#include "control/identification/structure_choice.hpp"
#include "control/identification/unit_doubts.hpp"
#include "control/search/missed_ticks.hpp"
#include "control/search/output_error_search.hpp"

namespace control {
namespace {

// Of least squares; its slope is the weight of each position.
double best_offset_m(OutputErrorSearch& search, const SearchPoint& point) {
  const std::vector<int> free = search.free_parameters(Structure::fractional);
  const auto at = std::ranges::find(free, kOffset);
  const Eigen::VectorXd slope = search.jacobians(Structure::fractional, point).front().col(at - free.begin());
  return slope.dot(search.residuals(point).front()) / slope.squaredNorm();
}

// With the dead time that the options have, or none.
Identification identified(const Recording& recording, const IdentificationOptions& options) {
  OutputErrorSearch search(recording, options);
  std::vector<Structure> structures{Structure::first_order, Structure::second_order, Structure::fractional};
  if (options.structure) structures = {*options.structure};

  if (!recording.acceleration_m_s2.empty()) search.find_sensor();
  Identification result;
  std::map<Structure, SearchPoint> points;
  for (const Structure structure : structures) {
    const SearchResult found = search.run(structure);
    if (search.limit().has_passed()) return out_of_time();
    points[structure] = found.point;
    result.compared.push_back(summary(search, recording, options.cost, structure, found));
  }
  put_best_first(result.compared);
  result.best = result.compared.front();
  result.amplitude = amplitude_evidence(search, recording, result.best, points[result.best.structure]);
  result.input = input_evidence(search, recording, result.best, points[result.best.structure]);
  const FittedRun fitted{search, recording, result.best, points[result.best.structure]};
  result.dead_zone = dead_zone_evidence({&fitted, 1});
  std::vector<std::string>& warnings = result.warnings;
  const auto add = [&](std::vector<std::string> more) { std::ranges::move(more, std::back_inserter(warnings)); };
  add(unit_doubts(recording));
  add(search_doubts(result.best, options));  // causes first, then what follows from them
  add(lag_doubts(recording, options, result.best));
  add(untried_structures(result.compared));
  add(second_opinions(search, recording, options, result.best));
  const bool order_is_forced = options.structure && *options.structure != Structure::fractional;
  add(amplitude_doubts(result.amplitude, recording, order_is_forced, options.names.structure));
  add(input_doubts(result.input, result.amplitude, options));
  add(residual_doubts(search, recording, options, result.best));
  add(identifiability_warnings(recording, result.best, options));
  add_verdict(result.compared, 1, warnings);
  add_rival(result.compared, warnings);
  if (search.limit().has_passed()) return out_of_time();  // a doubt may be missing
  result.doubts = doubts_about(result.best, result.amplitude, result.input, share_used({&recording, 1}));
  if (auto doubt = dead_time_doubt(result.best, options, recording.dt_s)) result.doubts.push_back(std::move(*doubt));
  return result;
}

}  // namespace

Identification out_of_time() {
  Identification none;
  none.best.end = SearchEnd::time_limit;
  return none;
}

namespace {

// Without a dead time that nobody named, or with it where the record asks for one and is explained better.
Identification with_own_dead_time(const Recording& recording, const IdentificationOptions& options) {
  const double deadline_s = steady_now_s() + options.time_limit_s;
  Identification found = identified(recording, options);
  if (!asks_for_dead_time(recording, options, found.best, found.amplitude, found.input)) return found;
  Identification late = identified(recording, with_dead_time(options, recording, deadline_s - steady_now_s()));
  if (late.best.end == SearchEnd::time_limit) return late;
  const bool by_acceleration = found.best.sensor.has_value();
  if (!is_explained_better({late.best, late.input}, {found.best, found.input}, by_acceleration)) return found;
  if (!by_acceleration) late.warnings.push_back(dead_time_in_words(late.best, recording.dt_s));
  return late;
}

}  // namespace

Identification identify(const Recording& recording, const IdentificationOptions& options) {
  check_recording(recording);
  check_options(options, recording);
  const Searching search = [](std::span<const Recording> one, const IdentificationOptions& of_search) {
    return with_own_dead_time(one.front(), of_search);
  };
  return with_own_dead_zone({&recording, 1}, options, search);
}

Fit evaluate(const FractionalModel& model, const Recording& recording, const IdentificationOptions& options) {
  check_recording(recording);
  IdentificationOptions fixed = options;
  fixed.structure = Structure::fractional;
  fixed.longest_dead_time_s = model.dead_time_s;  // so that the output can be as late
  check_options(fixed, recording);
  OutputErrorSearch search(recording, fixed);
  if (!recording.acceleration_m_s2.empty()) search.find_sensor();
  SearchResult found;
  found.point = search.start(Structure::fractional, 0);
  found.point.model = normalised(model);
  found.point.offset_m = 0;
  if (search.channels().front() == Channel::position && options.fits_offset) {
    found.point.offset_m = best_offset_m(search, found.point);
  }
  search.keep_dead_time(model.dead_time_s, found.point);
  if (search.limit().has_passed()) return out_of_time().best;
  found.end = search.limit().end().value_or(SearchEnd::converged);
  Fit fit = summary(search, recording, options.cost, Structure::fractional, found);
  fit.model.dead_time_s = model.dead_time_s;  // an acceleration shows only the sum of it and the sensor's delay
  if (fit.sensor) fit.sensor->delay_s -= model.dead_time_s;
  fit.one_sigma = {};
  fit.correlation = {};
  return fit;
}

}  // namespace control
