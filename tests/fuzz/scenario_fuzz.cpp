// Feeds any text to the readers of scenarios and of faults: what they do not take, they refuse as std::invalid_argument
// with a message, and what they take can be run.
#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "sim_robot/lab/scenario_run.hpp"
#include "tests/fuzz/targets.hpp"

namespace sim_robot {
namespace {

constexpr double kRunS = 0.05;

bool is_refused_well(const std::invalid_argument& error) { return !std::string_view{error.what()}.empty(); }

void run(Scenario scenario) {
  scenario.duration_s = kRunS;
  ScenarioRun run{scenario};
  run.run();
  if (run.time_s() < kRunS - kTickS) std::abort();
  run.bytes();
}

void read_scenario(std::string_view text) {
  Scenario scenario;
  try {
    scenario = parse_scenario(text, "fuzz.toml");
  } catch (const std::invalid_argument& error) {
    if (!is_refused_well(error)) std::abort();
    return;
  }
  run(std::move(scenario));
}

void read_fault(std::string_view text) {
  try {
    const Fault fault = parse_fault_json(text);
    if (type_of(fault.kind).name == nullptr) std::abort();
  } catch (const std::invalid_argument& error) {
    if (!is_refused_well(error)) std::abort();
  }
}

}  // namespace
}  // namespace sim_robot

int fuzz::scenario(const std::uint8_t* data, std::size_t size) {
  const std::string_view text{reinterpret_cast<const char*>(data), size};
  sim_robot::read_scenario(text);
  sim_robot::read_fault(text);
  return 0;
}
