// `rheonaut identify`: a model from a recording, and the uncertainty of a planned experiment.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "control/identification/identify.hpp"
#include "server/cli/design/control_files.hpp"
#include "server/cli/design/run_choice.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

inline constexpr int kNotConverged = 4;  // exit status

enum class PlannedDuty : std::uint8_t { prbs, step };
const char* text(PlannedDuty value);

// The duty of an experiment that has not been made.
struct Plan {
  bool is_wanted = false;
  PlannedDuty duty = PlannedDuty::prbs;
  double amplitude = 1;
  double duration_s = 60;
  double bit_s = 0.2;
  double dt_s = 0.01;
  double position_sd_m = 1.16e-3;
  double velocity_sd_m_s = 0;
  double acceleration_sd_m_s2 = 0;
};

control::IdentificationOptions usual_search();  // a dead time is looked for where the record asks for one

struct Identify {
  std::optional<std::string> csv;
  std::vector<std::int64_t> runs;  // of several one model is found
  std::filesystem::path data_dir = "rheonaut-data";
  // Each once, for all runs, or once for each run in their order.
  std::vector<std::uint32_t> spans;
  std::vector<double> from_s, to_s;
  bool with_velocity = false;
  bool cuts_at_gaps = false;
  analysis::ChannelChoice channels = analysis::ChannelChoice::best;
  control::IdentificationOptions search = usual_search();
  bool with_residuals = false;
  Plan plan;
  PlantChoice plant;  // of the plan
  OutputForm form;
};

void add_options(CLI::App& command, Identify& options);
void add_search(CLI::App& command, control::IdentificationOptions& options);  // how a model is searched for
// The fields of a job's body for what is not as usual.
nlohmann::json given_of(const control::IdentificationOptions& search);

// 0, or kNotConverged: then the best that was found stands in the answer.
int run(const Identify& options, std::ostream& out);

// Of the plan alone.
int run_plan(const Identify& options, std::ostream& out);

}  // namespace server::cli
