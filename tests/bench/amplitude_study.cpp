// Prints how often identification says that the parameters change with amplitude, or that the residuals follow the
// duty, and how often it names a dead zone, of motors that have none: amplitude_study [SEEDS [FIRST]].
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/sim_robot/identification_trial.hpp"

namespace {

constexpr double kPositionSdM = 0.0005;

enum class Drive { steps, levels, binary };
constexpr const char* kDriveNames[] = {"steps 0.2, 0.5, 0.8", "levels ±0.2, ±0.5, ±0.8", "binary ±0.6"};

struct Fluid {
  std::string name;
  control::FractionalModel model;
  sim_robot::PlantKind kind = sim_robot::PlantKind::linear;
};

std::vector<Fluid> fluids() {
  std::vector<Fluid> all{{"(29)", control::kNonNewtonianModel}, {"(28)", control::kNewtonianModel}};
  int number = 0;
  for (const auto& model : sim_robot::kStudyFluids) all.push_back({"study " + std::to_string(++number), model});
  all.push_back({"shear_thinning", {}, sim_robot::PlantKind::shear_thinning});
  return all;
}

std::vector<double> duty_of(Drive drive, std::uint64_t seed) {
  if (drive == Drive::steps) return sim_robot::steps_duty();
  return drive == Drive::levels ? sim_robot::levels_duty(seed) : sim_robot::study_duty();
}

struct Row {
  int doubts = 0, compared = 0, follow = 0, dead_zones = 0;
  double most_input_share = 0, most_input_f = 0;
  double least_share = 1, most_share = 0, least_f = 1e300, most_f = 0;
};

void add(const control::Recording& recording, Row& row) {
  control::IdentificationOptions options;
  options.structure = control::Structure::fractional;
  options.further_starts = 0;
  const auto found = control::identify(recording, options);
  const auto says = [&found](const char* begin) {
    return std::ranges::any_of(found.warnings, [begin](const std::string& text) { return text.starts_with(begin); });
  };
  row.doubts += says("the parameters change with amplitude") ? 1 : 0;
  row.follow += says("the residuals follow the duty") ? 1 : 0;
  row.dead_zones += found.dead_zone ? 1 : 0;
  if (found.input) {
    row.most_input_share = std::max(row.most_input_share, found.input->share);
    row.most_input_f = std::max(row.most_input_f, found.input->f);
  }
  if (!found.amplitude) return;
  ++row.compared;
  row.least_share = std::min(row.least_share, found.amplitude->share);
  row.most_share = std::max(row.most_share, found.amplitude->share);
  row.least_f = std::min(row.least_f, found.amplitude->f);
  row.most_f = std::max(row.most_f, found.amplitude->f);
}

void print(const Fluid& fluid, const char* fitted, Drive drive, const Row& row, int seeds) {
  std::printf("| %s | %s | %s | %d of %d | %.1f to %.1f %% | %.1f to %.1f | %d | up to %.1f %% | up to %.1f | %d |\n",
              fluid.name.c_str(), fitted, kDriveNames[static_cast<int>(drive)], row.doubts, seeds,
              100 * row.least_share, 100 * row.most_share, row.least_f, row.most_f, row.follow,
              100 * row.most_input_share, row.most_input_f, row.dead_zones);
  if (row.compared < seeds) std::printf("(%d of them compared)\n", row.compared);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 20, first = argc > 2 ? std::atoi(argv[2]) : 1;
  if (seeds < 1 || first < 1) return std::fprintf(stderr, "amplitude_study: SEEDS and FIRST are positive numbers\n"), 2;
  std::printf(
      "| fluid (%d seeds from %d) | fitted | duty | amplitude doubted | share | F | follows the duty | share | F | "
      "dead zone named |\n",
      seeds, first);
  std::printf("|---|---|---|---|---|---|---|---|---|---|\n");
  for (const Fluid& fluid : fluids()) {
    for (const Drive drive : {Drive::steps, Drive::levels, Drive::binary}) {
      Row acceleration, position;
      for (int seed = first; seed < first + seeds; ++seed) {
        const auto number = static_cast<std::uint64_t>(seed);
        const sim_robot::IdentificationTrial trial{
            .fluid = fluid.model, .duty = duty_of(drive, number), .kind = fluid.kind};
        add(sim_robot::record(trial, number), acceleration);
        add(sim_robot::record_position(trial, kPositionSdM, number), position);
      }
      print(fluid, "acceleration", drive, acceleration, seeds);
      print(fluid, "position", drive, position, seeds);
    }
  }
  return 0;
}
