// One pass for the directions, one for the bins.
#include "server/analysis/comparison/impedance_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/json_text.hpp"
#include "server/analysis/comparison/outside_at.hpp"
#include "server/storage/samples/position_sd.hpp"

namespace server::analysis {
namespace {

using nlohmann::ordered_json;

constexpr const char* kDetection = "detection";
constexpr const char* kZeroed = "position_zeroed";

// A sample that has both.
struct PlacedImpedance {
  double position_m = 0, sd_m = 0, impedance_mv = 0;
  std::uint32_t span = 0;
};

std::optional<PositionWithSd> position_of(const TracePoint& point, const storage::StoredReference* reference) {
  if (reference != nullptr) {
    if (point.span != reference->reference.span) return std::nullopt;
    return outside_at(*reference, point.robot_time_us);
  }
  const float position_m = point.position_m - point.disturbance_m;
  if (!std::isfinite(position_m)) return std::nullopt;
  return PositionWithSd{static_cast<double>(position_m), static_cast<double>(point.position_sd_m)};
}

// The direction of each sample: it turns where the way back from the farthest point is longer than `turn_m`, and has
// then turned there. In every span anew.
class Directions {
 public:
  explicit Directions(double turn_m) : turn_m_{turn_m} {}

  std::vector<Direction> of(std::span<const PlacedImpedance> samples) {
    directions_.assign(samples.size(), Direction::forward);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (i == 0 || samples[i].span != samples[i - 1].span) begin(i);
      take(samples, i);
    }
    return std::move(directions_);
  }

 private:
  void begin(std::size_t i) {
    begins_ = lowest_ = highest_ = i;
    known_ = false;
  }
  void take(std::span<const PlacedImpedance> samples, std::size_t i) {
    const auto at_m = [&](std::size_t k) { return samples[k].position_m; };
    if (at_m(i) > at_m(highest_)) highest_ = i;
    if (at_m(i) < at_m(lowest_)) lowest_ = i;
    const bool goes_up = at_m(i) - at_m(lowest_) > turn_m_, goes_down = at_m(highest_) - at_m(i) > turn_m_;
    if (goes_up && (!known_ || now_ == Direction::backward)) {
      turn(Direction::forward, lowest_, i);
      highest_ = i;
    } else if (goes_down && (!known_ || now_ == Direction::forward)) {
      turn(Direction::backward, highest_, i);
      lowest_ = i;
    } else if (known_ && now_ == Direction::forward) {
      lowest_ = highest_;
    } else if (known_) {
      highest_ = lowest_;
    }
    directions_[i] = known_ ? now_ : Direction::forward;
  }
  // The motion until the turn was the other one; at the beginning of a span there was none before.
  void turn(Direction to, std::size_t at, std::size_t now) {
    const std::size_t from = known_ ? at : begins_;
    std::fill(directions_.begin() + static_cast<std::ptrdiff_t>(from),
              directions_.begin() + static_cast<std::ptrdiff_t>(now), to);
    now_ = to;
    known_ = true;
  }

  double turn_m_;
  std::vector<Direction> directions_;
  std::size_t begins_ = 0, lowest_ = 0, highest_ = 0;
  Direction now_ = Direction::forward;
  bool known_ = false;
};

std::vector<ImpedanceEvent> events_on_map(storage::RunId run, std::span<const TracePoint> points,
                                          std::span<const storage::RunMoment> moments,
                                          const storage::StoredReference* reference) {
  std::vector<ImpedanceEvent> events;
  const std::vector<double> times_s = times_of(points);
  for (const storage::RunMoment& moment : moments) {
    if (moment.name == kZeroed) continue;
    const auto is_sample = [&](const TracePoint& point) {
      return point.span == moment.span && point.seq == moment.seq;
    };
    const auto sample = std::ranges::find_if(points, is_sample);
    ImpedanceEvent event{run,          moment.name,
                         std::nan(""), static_cast<double>(moment.position_m),
                         std::nan(""), static_cast<double>(moment.value)};
    if (sample != points.end()) {
      event.at_s = times_s[static_cast<std::size_t>(sample - points.begin())];
      if (const auto position = position_of(*sample, reference)) {
        event.position_m = position->position_m;
        event.position_sd_m = position->sd_m;
      }
    }
    events.push_back(std::move(event));
  }
  return events;
}

// What a reader must know before believing the positions.
std::vector<std::string> warnings_of(const ImpedanceMap& map, std::span<const TracePoint> points,
                                     std::span<const storage::RunMoment> events) {
  std::vector<std::string> warnings;
  if (map.sources.front() == PositionSource::estimate) {
    warnings.emplace_back("positions are the robot's own estimate: where the vessel is, is known only within their sd");
  }
  if (!points.empty() && points.front().span != points.back().span) {
    warnings.emplace_back(
        "the robot rebooted during the run: positions before and after may count from different points");
  }
  if (std::ranges::any_of(events, [](const auto& event) { return event.name == kZeroed; })) {
    warnings.emplace_back(
        "the robot's position was set to 0 during the run: positions before count from another point");
  }
  return warnings;
}

// The columns of one direction.
ordered_json direction_json(const ImpedanceMap& map, Direction direction) {
  ordered_json out;
  for (const char* name : {"from_m", "count", "runs", "mean_mv", "sd_mv", "min_mv", "position_sd_m"}) {
    out[name] = ordered_json::array();
  }
  for (const auto& [key, bin] : map.bins) {
    if (key.first != direction) continue;
    const auto add = [&](const char* name, double value) {
      out[name].emplace_back(base::decimal(static_cast<float>(value)));
    };
    add("from_m", static_cast<double>(key.second) * map.bin_m);
    out["count"].emplace_back(bin.count);
    out["runs"].emplace_back(bin.runs);
    add("mean_mv", bin.mean_mv);
    add("sd_mv", bin.sd_mv().value_or(std::nan("")));
    add("min_mv", bin.min_mv);
    add("position_sd_m", bin.position_sd_m);
  }
  return out;
}

ordered_json event_json(const ImpedanceEvent& event) {
  const auto decimal = [](double value) { return base::decimal(static_cast<float>(value)); };
  return {{"run_id", event.run},
          {"kind", event.kind},
          {"at_s", decimal(event.at_s)},
          {"position_m", decimal(event.position_m)},
          {"position_sd_m", decimal(event.position_sd_m)},
          {"value", decimal(event.value)}};
}

}  // namespace

const std::vector<std::string>& kinds_on_impedance_map() {
  static const std::vector<std::string> kKinds{kDetection, "delivery_started", "delivery_ended", kZeroed};
  return kKinds;
}

void ImpedanceBin::add(double impedance_mv, double sd_m) {
  min_mv = count == 0 ? impedance_mv : std::min(min_mv, impedance_mv);
  ++count;
  const double step_mv = impedance_mv - mean_mv;
  mean_mv += step_mv / static_cast<double>(count);
  squares_mv2 += step_mv * (impedance_mv - mean_mv);
  position_sd_m = storage::larger_sd_m(position_sd_m, sd_m);
}

void ImpedanceBin::merge(const ImpedanceBin& other) {
  const auto mine = static_cast<double>(count), theirs = static_cast<double>(other.count);
  const double step_mv = other.mean_mv - mean_mv;
  mean_mv += step_mv * theirs / (mine + theirs);
  squares_mv2 += other.squares_mv2 + step_mv * step_mv * mine * theirs / (mine + theirs);
  min_mv = std::min(min_mv, other.min_mv);
  position_sd_m = storage::larger_sd_m(position_sd_m, other.position_sd_m);
  count += other.count;
  runs += other.runs;
}

std::optional<double> ImpedanceBin::sd_mv() const {
  if (count < 2) return std::nullopt;
  return std::sqrt(squares_mv2 / (static_cast<double>(count) - 1));
}

std::vector<std::string> ImpedanceMap::all_warnings() const {
  std::vector<std::string> all = warnings;
  const auto warn = [&](const char* what, auto is_so) {
    const auto count =
        std::ranges::count_if(bins, [&](const auto& entry) { return is_so(entry.second.position_sd_m); });
    if (count > 0)
      all.push_back(fmt::format("in {} of {} bins the sd of the position is {}", count, bins.size(), what));
  };
  warn("larger than the bin is wide", [&](double sd_m) { return sd_m > bin_m; });
  warn("not known", [](double sd_m) { return std::isnan(sd_m); });
  return all;
}

bool ImpedanceMap::has_detections() const {
  return std::ranges::any_of(events, [](const ImpedanceEvent& event) { return event.kind == kDetection; });
}

Result<ImpedanceMap> impedance_map(storage::RunId run, std::span<const TracePoint> points,
                                   std::span<const storage::RunMoment> events, double bin_m,
                                   const storage::StoredReference* reference) {
  ImpedanceMap map;
  map.bin_m = bin_m;
  map.runs = {run};
  std::vector<PlacedImpedance> samples;
  bool is_estimate = false;
  for (const TracePoint& point : points) {
    const auto position = position_of(point, reference);
    is_estimate = is_estimate || storage::is_estimate(static_cast<double>(point.position_sd_m));
    if (!position || !std::isfinite(point.impedance_mv)) {
      ++map.samples_left_out;
      continue;
    }
    samples.push_back({position->position_m, position->sd_m, static_cast<double>(point.impedance_mv), point.span});
  }
  map.samples = samples.size();
  const PositionSource own = is_estimate ? PositionSource::estimate : PositionSource::known;
  map.sources = {reference != nullptr ? PositionSource::outside : own};
  const std::vector<Direction> directions = Directions{bin_m}.of(samples);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto number = static_cast<std::int64_t>(std::floor(samples[i].position_m / bin_m));
    map.bins[{directions[i], number}].add(samples[i].impedance_mv, samples[i].sd_m);
    if (map.bins.size() > kMaxImpedanceBins) {
      return fail(ErrorCode::invalid,
                  fmt::format("run {} has more than {} bins of {} m; choose wider ones", run, kMaxImpedanceBins, bin_m),
                  "too_many_bins");
    }
  }
  map.events = events_on_map(run, points, events, reference);
  map.warnings = warnings_of(map, points, events);
  return map;
}

ImpedanceMap together(std::span<const ImpedanceMap> maps) {
  ImpedanceMap all = maps.front();
  for (const ImpedanceMap& map : maps.subspan(1)) {
    for (const auto& [key, bin] : map.bins) {
      const auto [at, is_new] = all.bins.try_emplace(key, bin);
      if (!is_new) at->second.merge(bin);
    }
    all.runs.insert(all.runs.end(), map.runs.begin(), map.runs.end());
    all.sources.insert(all.sources.end(), map.sources.begin(), map.sources.end());
    all.events.insert(all.events.end(), map.events.begin(), map.events.end());
    all.samples += map.samples;
    all.samples_left_out += map.samples_left_out;
    for (const std::string& warning : map.warnings) {
      if (std::ranges::find(all.warnings, warning) == all.warnings.end()) all.warnings.push_back(warning);
    }
  }
  return all;
}

ordered_json json_of(const ImpedanceMap& map) {
  ordered_json out{{"bin_m", map.bin_m},
                   {"run_ids", map.runs},
                   {"position_sources", ordered_json::array()},
                   {"samples", map.samples},
                   {"samples_left_out", map.samples_left_out}};
  for (const PositionSource source : map.sources) out["position_sources"].emplace_back(text(source));
  out["forward"] = direction_json(map, Direction::forward);
  out["backward"] = direction_json(map, Direction::backward);
  out["events"] = ordered_json::array();
  for (const ImpedanceEvent& event : map.events) out["events"].emplace_back(event_json(event));
  out["warnings"] = map.all_warnings();
  return out;
}

}  // namespace server::analysis
