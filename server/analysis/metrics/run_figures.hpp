// The figures of a whole run: how complete its record is, and how hard the robot was driven.
//
// Times are those of the robot; a sample counts for one period, the usual distance of samples. Pure and slow for long
// runs: call it on a worker.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/analysis/metrics/run_steps.hpp"
#include "server/storage/runs/run.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::analysis {

// What of a stored sample matters for figures and steps.
struct RunPoint {
  StepPoint step;
  float duty = 0;
  std::uint32_t flags = 0;
  bool is_latched = false;
};
RunPoint run_point(const storage::StoredSample& stored);

// By name with unit; none: the run has nothing that says it.
using Figures = std::vector<std::pair<const char*, std::optional<double>>>;

// Points in order of span and seq, all of the run's.
Figures run_figures(std::span<const RunPoint> points, const storage::Run& run);

struct RunMetrics {
  Figures figures;
  RunMeasures measures;
};

}  // namespace server::analysis
