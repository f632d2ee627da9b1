// `rheonaut step`.
#include "server/cli/design/step.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "control/responses/margins.hpp"
#include "control/responses/time_response.hpp"
#include "server/analysis/control_json.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

constexpr double kFirstTime_s = 0.01;
constexpr int kLogSpacedTimes = 20;
constexpr double kMaxTimes = 1'000'000;

std::vector<double> times_of(const Step& options) {
  if (!options.times_s.empty()) return options.times_s;
  if (!options.every_s)
    return control::log_spaced(std::min(kFirstTime_s, options.until_s / 2), options.until_s, kLogSpacedTimes);
  const double count = std::floor(options.until_s / *options.every_s * (1 + 1e-12)) + 1;
  if (!(count <= kMaxTimes)) {
    throw UsageError{fmt::format("--every-s {} up to --until-s {} makes {} times; at most {} are allowed",
                                 *options.every_s, options.until_s, count, kMaxTimes)};
  }
  std::vector<double> times_s;
  times_s.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < static_cast<int>(count); ++i) times_s.push_back(i * *options.every_s);
  return times_s;
}

void write_table(std::ostream& out, std::span<const double> times_s, std::span<const double> duty,
                 const control::TimeResponse& response) {
  Table table{{"time (s)", "duty", "velocity (m/s)", "position (m)"}};
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    table.row({cell(times_s[i], 5), cell(duty[i], 4), cell(response.velocity_m_s[i]), cell(response.position_m[i])});
  }
  table.write(out);
}

}  // namespace

void add_options(CLI::App& command, Step& options) {
  add_option(command, options.plant);
  auto* duty = command.add_option("--duty", options.duty, "Height of the step, -1 to 1 (default: 0.3)");
  duty->check(from_to(-1, 1));
  auto* times = command.add_option("--times", options.times_s, "Times in s, e.g. 0.1,1,5,60")->delimiter(',');
  times->check(non_negative());
  auto* every = command.add_option("--every-s", options.every_s, "Equally spaced times from 0 on");
  every->check(positive())->excludes(times);
  auto* until = command.add_option("--until-s", options.until_s, "The last time (default: 60)");
  until->check(positive())->excludes(times);
  command
      .add_option("--duty-csv", options.duty_csv,
                  "Any input: CSV with columns t_s and duty, which holds until the next")
      ->check(named())
      ->excludes(duty)
      ->excludes(times)
      ->excludes(every)
      ->excludes(until);
  add_json_and_csv_flags(command, options.form);
  command.footer("Example: rheonaut step --duty 0.3 --times 0.1,1,5,60");
}

int run(const Step& options, std::ostream& out) {
  const Plant read_plant = read(options.plant);
  say_doubts(options.plant, read_plant);
  const control::FractionalModel& plant = read_plant.model;
  std::vector<double> times_s, duty;
  control::TimeResponse response;
  if (!options.duty_csv) {
    times_s = times_of(options);
    duty.assign(times_s.size(), options.duty);
    response = control::step_response(plant, options.duty, times_s);
  } else {
    analysis::CsvColumns columns = read_csv(*options.duty_csv, {"t_s", "duty"});
    times_s = std::move(columns["t_s"]);
    duty = std::move(columns["duty"]);
    response = control::sampled_response(plant, times_s, duty);
  }
  if (options.form.is_csv) {
    write_csv(out, {{"t_s", times_s},
                    {"duty", duty},
                    {"velocity_m_s", response.velocity_m_s},
                    {"position_m", response.position_m}});
  } else if (options.form.is_json) {
    write_json(out, {{"t_s", times_s},
                     {"duty", duty},
                     {"velocity_m_s", response.velocity_m_s},
                     {"position_m", response.position_m},
                     {"plant", analysis::json_of(plant)}});
  } else {
    write_table(out, times_s, duty, response);
  }
  return 0;
}

}  // namespace server::cli
