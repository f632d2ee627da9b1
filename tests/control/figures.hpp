// Parts that the tests of the figures share: the paper's experiment in closed loop, and a place for the curves.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
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

// The folder that RHEONAUT_FIGURES names, or else one of this process, which goes with it.
class FigureFolder {
 public:
  FigureFolder() {
    if (const char* named = std::getenv("RHEONAUT_FIGURES")) {
      path_ = named;
      std::filesystem::create_directories(path_);
      return;
    }
    std::string name = (std::filesystem::temp_directory_path() / "rheonaut-figures-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + name};
    path_ = name;
    is_temporary_ = true;
  }
  ~FigureFolder() {
    std::error_code ignored;
    if (is_temporary_) std::filesystem::remove_all(path_, ignored);
  }
  FigureFolder(const FigureFolder&) = delete;
  FigureFolder& operator=(const FigureFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  bool is_temporary_ = false;
};

inline std::filesystem::path figure_path(const std::string& name) {
  static const FigureFolder folder;
  return folder.path() / name;
}

inline void write_figure(const std::string& name, const std::vector<FigureColumn>& columns) {
  const std::filesystem::path path = figure_path(name);
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
