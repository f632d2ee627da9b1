// The files that the tools read: models, controllers and recordings.
//
// Errors: throws std::runtime_error naming the file, the place in it, what is wrong and what is allowed.
#pragma once

#include <optional>
#include <ostream>
#include <string>

#include "control/identification/identify.hpp"
#include "control/identification/planned_experiment.hpp"
#include "control/models/transfer_function.hpp"
#include "control/tuning/margin_uncertainty.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/csv_columns.hpp"
#include "server/analysis/run_recording.hpp"

namespace CLI {
class App;
}

namespace server::cli {

// Which plant and controller: files, or none for the paper's.
struct PlantChoice {
  std::optional<std::string> file;  // or newtonian, non_newtonian
};
struct ControllerChoice {
  std::optional<std::string> file;
};

void add_option(CLI::App& command, PlantChoice& choice);
void add_option(CLI::App& command, ControllerChoice& choice);

// How well the parameters are known, and what is in doubt, where identify has made the file.
struct Plant {
  control::FractionalModel model;
  std::optional<control::ExpectedUncertainty> uncertainty;
  analysis::ModelDoubts doubts;
};

Plant read(const PlantChoice& choice);  // once, since it may be a pipe; none: (29)
// In one line on standard error, where something is in doubt that widens what is computed from the plant.
void say_doubts(const PlantChoice& choice, const Plant& plant);

// ± 2 sd of margin, crossover and phase slope, or that they are not known; nothing for the paper's models.
void say_margin_sigmas(std::ostream& out, const PlantChoice& choice,
                       const std::optional<control::MarginUncertainty>& sigmas);

control::FopdController read(const ControllerChoice& choice);  // none: (30)

analysis::CsvColumns read_csv(const std::string& file, std::initializer_list<const char*> required,
                              std::initializer_list<const char*> optional = {},
                              std::initializer_list<const char*> with_gaps = {});

// Columns t_s (or robot_time_us, as the station exports), duty, and position_m or velocity_m_s or both. Where a column
// position_sd_m says that the position is an estimate (an empty cell does, too), acceleration_m_s2 is taken in their
// place. A file with that column is a robot's record and is read as a run is: in binary32, with_velocity only if asked
// for. A column disturbance_m is subtracted from position_m, to which the robot adds it.
analysis::RunRecording read_recording(const std::string& file, bool with_velocity);

}  // namespace server::cli
