// What the tests of the closed-loop figures share: the experiment of the paper, and a place for its curves.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "control/discretisation/discretise.hpp"
#include "control/responses/closed_loop.hpp"

namespace control {

// 0.1 m at 0 s, the paper's controller as the robot runs it, duty in [-1, 1].
inline ClosedLoopExperiment figure_experiment(const FractionalModel& plant) {
  ClosedLoopExperiment experiment;
  experiment.plant = plant;
  experiment.controller = discretise(kPaperController, {}).sections;
  return experiment;
}

struct FigureColumn {
  std::string name;
  std::vector<double> values;
};

// Into the folder that RHEONAUT_FIGURES names, or else the temporary one.
inline void write_figure(const std::string& name, const std::vector<FigureColumn>& columns) {
  const char* folder = std::getenv("RHEONAUT_FIGURES");
  const std::string path = (folder ? std::string(folder) + "/" : testing::TempDir()) + name;
  std::ofstream file(path);
  for (std::size_t i = 0; i < columns.size(); ++i) file << (i ? "," : "") << columns[i].name;
  file << '\n';
  for (std::size_t row = 0; row < columns.front().values.size(); ++row) {
    for (std::size_t i = 0; i < columns.size(); ++i) file << (i ? "," : "") << columns[i].values[row];
    file << '\n';
  }
  ASSERT_TRUE(file.flush()) << "could not write " << path;
}

inline void write_figure(const std::string& name, const ClosedLoopPrediction& prediction) {
  write_figure(name, {{"t_s", prediction.time_s},
                      {"reference_m", prediction.reference_m},
                      {"position_m", prediction.measured_m},
                      {"duty", prediction.duty}});
}

}  // namespace control
