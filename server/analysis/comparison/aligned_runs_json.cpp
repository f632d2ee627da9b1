// Names with units, as everywhere.
#include "server/analysis/comparison/aligned_runs_json.hpp"

#include <algorithm>
#include <cmath>

#include "base/json_text.hpp"

namespace server::analysis {
namespace {

using nlohmann::ordered_json;

ordered_json column_json(const std::vector<float>& column) {
  ordered_json out = ordered_json::array();
  for (const float value : column) out.emplace_back(base::decimal(value));
  return out;
}

double rounded(double value) { return std::round(value * 1e6) / 1e6; }  // to the microsecond

ordered_json run_json(const AlignedRuns& aligned, std::size_t index) {
  const AlignedRun& run = aligned.runs[index];
  const TraceChannels& channels = aligned.request.channels;
  const bool is_reference = index == aligned.reference;
  const auto is_position = [](const TraceChannel* channel) { return channel->member == &TracePoint::position_m; };
  const bool has_position = std::ranges::any_of(channels, is_position);
  ordered_json out{{"run_id", run.id},
                   {"name", run.name},
                   {"aligned_at_s", rounded(run.aligned.at_s)},
                   {"aligned_at_utc_us", run.aligned.utc_us},
                   {"span", run.aligned.span},
                   {"seq", run.aligned.seq},
                   {"uncertain_s", rounded(run.aligned.uncertain_s)},
                   {"position_source", text(run.trace.position_source)},
                   {"traces", ordered_json::object()},
                   {"differences", is_reference ? ordered_json{} : ordered_json::object()}};
  for (std::size_t c = 0; c < channels.size(); ++c) {
    out["traces"][channels[c]->name] = column_json(run.trace.values[c]);
    if (!is_reference) out["differences"][channels[c]->name] = column_json(difference(aligned, index, c));
  }
  out["position_sd_m"] = has_position ? column_json(run.trace.position_sd_m) : ordered_json{};
  out["own_position_m"] = run.trace.own_position_m.empty() ? ordered_json{} : column_json(run.trace.own_position_m);
  out["difference_sd_m"] =
      has_position && !is_reference ? column_json(difference_sd_m(aligned, index)) : ordered_json{};
  return out;
}

}  // namespace

ordered_json json_of(const Alignment& alignment) {
  ordered_json out{{"at", text(alignment.at)}, {"number", alignment.number}, {"event", nullptr}, {"marker", nullptr}};
  if (alignment.at == AlignAt::event) out["event"] = alignment.name;
  if (alignment.at == AlignAt::marker && !alignment.name.empty()) out["marker"] = alignment.name;
  return out;
}

ordered_json json_of(const AlignedRuns& aligned) {
  ordered_json out{{"align", json_of(aligned.request.alignment)},
                   {"reference_run_id", aligned.runs[aligned.reference].id},
                   {"grid_s", rounded(aligned.grid_s)},
                   {"time_s", ordered_json::array()},
                   {"runs", ordered_json::array()}};
  for (const double time_s : aligned.time_s) out["time_s"].push_back(rounded(time_s));
  for (std::size_t run = 0; run < aligned.runs.size(); ++run) out["runs"].push_back(run_json(aligned, run));
  return out;
}

}  // namespace server::analysis
