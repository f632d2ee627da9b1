// Impedance against position, as in Figure A2 of the paper: bins of the position, going forward and coming back
// separately, with detections and deliveries.
//
// The position is that measured from outside where the run has one (samples without it are left out), else the robot's
// own without the disturbance: then the vessel is known only from the estimate, within its sd. A robot turns where it
// moves back by more than a bin; while it stands it belongs to the motion before. Pure and slow for long runs: call it
// on a worker.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/analysis/comparison/grid_trace.hpp"
#include "server/analysis/comparison/trace.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/query/run_events.hpp"
#include "server/storage/runs/outside_reference.hpp"

namespace server::analysis {

inline constexpr std::int64_t kUsualBinMm = 5, kNarrowestBinMm = 1, kWidestBinMm = 1000;
inline constexpr std::size_t kMaxImpedanceBins = 2'000;

// Of the events that a map shows, and one more that shifts its positions.
const std::vector<std::string>& kinds_on_impedance_map();

enum class Direction : std::uint8_t { forward, backward };  // towards larger or smaller positions

// Samples of one bin in one direction.
struct ImpedanceBin {
  std::size_t count = 0;
  double mean_mv = 0, squares_mv2 = 0;  // the sum of the squares about the mean
  double min_mv = 0;
  double position_sd_m = 0;  // the largest
  std::size_t runs = 1;

  void add(double impedance_mv, double sd_m);
  void merge(const ImpedanceBin& other);  // of other runs
  std::optional<double> sd_mv() const;    // none for a single sample
};

struct ImpedanceEvent {
  storage::RunId run = 0;
  std::string kind;
  double at_s = 0;  // since the first sample of the run
  double position_m = 0;
  double position_sd_m = 0;  // NaN: the sample of then is not stored
  double value = 0;          // mV; of the end of a delivery its seconds
};

struct ImpedanceMap {
  double bin_m = 0;
  std::vector<storage::RunId> runs;
  std::vector<PositionSource> sources;                              // of each run
  std::map<std::pair<Direction, std::int64_t>, ImpedanceBin> bins;  // by the number of the bin, from 0 m on
  std::vector<ImpedanceEvent> events;
  std::size_t samples = 0, samples_left_out = 0;  // without impedance or position
  std::vector<std::string> warnings;              // what to know before believing the positions

  std::vector<std::string> all_warnings() const;  // and how certain they are beside the width of the bins
  bool has_detections() const;
};

// invalid: more bins than kMaxImpedanceBins.
Result<ImpedanceMap> impedance_map(storage::RunId run, std::span<const TracePoint> points,
                                   std::span<const storage::RunMoment> events, double bin_m,
                                   const storage::StoredReference* reference);
// Of all runs together; at least one, with the same bins.
ImpedanceMap together(std::span<const ImpedanceMap> maps);

nlohmann::ordered_json json_of(const ImpedanceMap& map);

}  // namespace server::analysis
