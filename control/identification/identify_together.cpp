// Fits one model to several recordings: the same steps as for one, over all of them.
#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "base/invalid_argument.hpp"
#include "control/evidence/score_doubts.hpp"
#include "control/identification/further_search.hpp"
#include "control/identification/identifiability.hpp"
#include "control/identification/identify.hpp"
#include "control/identification/joint_fit.hpp"
#include "control/identification/recording_checks.hpp"
#include "control/identification/residual_doubts.hpp"
#include "control/identification/second_opinions.hpp"
#include "control/identification/structure_choice.hpp"
#include "control/identification/unit_doubts.hpp"
#include "control/search/missed_ticks.hpp"

namespace control {
namespace {

void append(std::vector<std::string>& warnings, std::vector<std::string> more) {
  std::ranges::move(more, std::back_inserter(warnings));
}

void check_together(std::span<const Recording> recordings, const IdentificationOptions& options) {
  if (recordings.empty() || recordings.size() > kMostRecordings) {
    base::throw_invalid("identification: ", recordings.size(), " recordings: give 1 to ", kMostRecordings);
  }
  std::size_t samples = 0;
  bool has_acceleration = false;
  for (const Recording& recording : recordings) {
    samples += recording.duty.size();
    has_acceleration = has_acceleration || !recording.acceleration_m_s2.empty();
  }
  if (samples > kMostSamples) {
    base::throw_invalid("identification: the recordings have ", samples, " samples together, more than ", kMostSamples);
  }
  for (const Recording& recording : recordings) {
    IdentificationOptions of_run = options;
    if (has_acceleration && recording.acceleration_m_s2.empty()) of_run.sensor_lag_s.reset();
    check_recording(recording);
    check_options(of_run, recording);
  }
}

void keep_clearer(const std::optional<ScoreEvidence>& evidence, std::optional<ScoreEvidence>& kept) {
  if (evidence && (!kept || evidence->f > kept->f)) kept = evidence;
}

// Evidence of all runs whose readings have no delay of their own.
std::optional<ScoreEvidence> clearest_input(const Identification& found) {
  std::optional<ScoreEvidence> clearest;
  for (const JointRun& run : found.runs) {
    if (!run.fit.sensor) keep_clearer(run.input, clearest);
  }
  return clearest;
}

// What concerns one run only.
std::vector<std::string> doubts_of(JointSearch& search, std::size_t i, const Recording& recording,
                                   const IdentificationOptions& options, const JointRun& run) {
  const Fit& fit = run.fit;
  std::vector<std::string> warnings;
  append(warnings, unit_doubts(recording));
  append(warnings, lag_doubts(recording, options, fit));
  append(warnings, second_opinions(search.of_run(i), recording, options, fit));
  const bool order_is_forced = options.structure && *options.structure != Structure::fractional;
  append(warnings, amplitude_doubts(run.amplitude, recording, order_is_forced, options.names.structure));
  append(warnings, input_doubts(run.input, run.amplitude, options));
  append(warnings, residual_doubts(search.of_run(i), recording, options, fit));
  return warnings;
}

void add_runs(JointSearch& search, std::span<const Recording> recordings, const IdentificationOptions& options,
              const JointResult& found, JointFit fit, Identification& result) {
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    JointRun run{std::move(fit.runs[i]), {}, {}, {}};
    run.amplitude = amplitude_evidence(search.of_run(i), recordings[i], run.fit, found.points[i]);
    run.input = input_evidence(search.of_run(i), recordings[i], run.fit, found.points[i]);
    keep_clearer(run.amplitude, result.amplitude);
    if (follows_input(run.input) && !changes_with_amplitude(run.amplitude)) keep_clearer(run.input, result.input);
    run.warnings = doubts_of(search, i, recordings[i], options, run);
    result.runs.push_back(std::move(run));
  }
}

// In the motor of all of them.
std::optional<DeadZone> common_dead_zone(JointSearch& search, std::span<const Recording> recordings,
                                         const JointResult& found, const Identification& result) {
  std::vector<FittedRun> fitted;
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    fitted.push_back({search.of_run(i), recordings[i], result.runs[i].fit, found.points[i]});
  }
  return dead_zone_evidence(fitted);
}

// The farthest of the runs, of each parameter of a sensor.
void add_sensors(Identification& result) {
  for (const JointRun& run : result.runs) {
    for (Doubt& doubt : sensor_doubts(run.fit)) {
      const auto same = std::ranges::find_if(result.doubts, [&doubt](const Doubt& one) {
        return one.code == doubt.code && one.parameter == doubt.parameter;
      });
      if (same == result.doubts.end()) {
        result.doubts.push_back(std::move(doubt));
      } else if (doubt.value > same->value) {
        *same = std::move(doubt);
      }
    }
  }
}

// With the dead time that the options have, or none.
Identification identified(std::span<const Recording> recordings, const IdentificationOptions& options) {
  JointSearch search(recordings, options);
  std::vector<Structure> structures{Structure::first_order, Structure::second_order, Structure::fractional};
  if (options.structure) structures = {*options.structure};

  search.find_sensors();
  Identification result;
  std::map<Structure, JointResult> found;
  std::map<Structure, JointFit> fits;
  for (const Structure structure : structures) {
    found[structure] = search.run(structure);
    if (search.is_out_of_time()) return out_of_time();
    fits[structure] = joint_summary(search, recordings, options.cost, structure, found[structure]);
    result.compared.push_back(fits[structure].all);
  }
  put_best_first(result.compared);
  result.best = result.compared.front();
  const Structure best = result.best.structure;
  add_runs(search, recordings, options, found[best], std::move(fits[best]), result);
  result.dead_zone = common_dead_zone(search, recordings, found[best], result);
  std::vector<std::string>& warnings = result.warnings;
  append(warnings, search_doubts(result.best, options));
  append(warnings, untried_structures(result.compared));
  const auto disagreeing = disagreement(search, best, found[best]);
  if (disagreeing) warnings.push_back(disagreement_in_words(*disagreeing));
  const std::size_t longest = search.longest();
  append(warnings, identifiability_warnings(recordings[longest], result.runs[longest].fit, options, recordings.size()));
  add_verdict(result.compared, recordings.size(), warnings);
  add_rival(result.compared, warnings);
  if (search.is_out_of_time()) return out_of_time();  // a doubt may be missing
  result.doubts = doubts_about(result.best, result.amplitude, result.input, share_used(recordings));
  add_sensors(result);
  if (disagreeing) {
    result.doubts.push_back({DoubtCode::runs_disagree, disagreeing->share, {}, disagreeing->widening});
  }
  if (auto doubt = dead_time_doubt(result.runs[longest].fit, options, recordings[longest].dt_s)) {
    result.doubts.push_back(std::move(*doubt));
  }
  return result;
}

// Without a dead time that nobody named, or with it where a run asks for one and all are explained better.
Identification with_own_dead_time(std::span<const Recording> recordings, const IdentificationOptions& options) {
  const double deadline_s = steady_now_s() + options.time_limit_s;
  Identification found = identified(recordings, options);
  bool asks = false, by_acceleration = false;
  for (std::size_t i = 0; i < found.runs.size(); ++i) {
    const JointRun& run = found.runs[i];
    const bool run_asks = asks_for_dead_time(recordings[i], options, run.fit, run.amplitude, run.input);
    asks = asks || run_asks;
    by_acceleration = by_acceleration || (run_asks && run.fit.sensor);
  }
  if (!asks) return found;
  const Recording& shortest = *std::ranges::min_element(
      recordings, {}, [](const Recording& one) { return one.dt_s * static_cast<double>(one.duty.size()); });
  Identification late = identified(recordings, with_dead_time(options, shortest, deadline_s - steady_now_s()));
  if (late.best.end == SearchEnd::time_limit) return late;
  const auto input_left = clearest_input(late), input_before = clearest_input(found);
  if (!is_explained_better({late.best, input_left}, {found.best, input_before}, by_acceleration)) return found;
  if (!by_acceleration) late.warnings.push_back(dead_time_in_words(late.best, shortest.dt_s));
  return late;
}

}  // namespace

Identification identify_together(std::span<const Recording> recordings, const IdentificationOptions& options) {
  if (recordings.size() == 1) return identify(recordings.front(), options);
  check_together(recordings, options);
  return with_own_dead_zone(recordings, options, with_own_dead_time);
}

}  // namespace control
