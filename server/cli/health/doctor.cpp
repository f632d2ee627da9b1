// The checks in their order, and how their findings are printed.
#include "server/cli/health/doctor.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "base/version.hpp"
#include "server/cli/health/folder_checks.hpp"
#include "server/cli/health/machine_checks.hpp"
#include "server/cli/health/running_station.hpp"
#include "server/cli/health/store_checks.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/config/file_system.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"

namespace server::cli {
namespace {

// A configuration that is wrong is a finding, and the defaults are looked at.
config::Config read_config(const config::ConfigFlags& flags, Findings& findings) {
  try {
    config::Config config = load_config(flags);
    findings.fine("config", flags.file ? flags.file->string() + " is valid" : "no file was given: the defaults");
    return config;
  } catch (const std::exception& error) {
    findings.problem("config", one_line(runtime::text_of(error)),
                     "correct it; rheonaut check-config shows what it means then");
    config::Config defaults;
    if (flags.data_dir) defaults.data_dir = *flags.data_dir;
    return defaults;
  }
}

}  // namespace

Findings examine(const config::ConfigFlags& flags) {
  Findings findings;
  const config::Config config = read_config(flags, findings);
  ClockFacts clock = measure_clock();
  if (!std::filesystem::is_directory(config.data_dir)) {
    findings.problem("data", fmt::format("there is no data folder {}", config.data_dir.string()),
                     "name it with --data, or in the configuration with --config; rheonaut serve makes a new one");
    judge_clock(clock, findings);
    return findings;
  }
  if (const auto denial = runtime::denied(config.data_dir, R_OK | X_OK)) {
    findings.problem("data", one_line(*denial), "run rheonaut doctor as that user, or as root");
    judge_clock(clock, findings);
    return findings;
  }
  const RunningStation running = look_for_station(config.data_dir);
  check_station(running, config.data_dir, findings);
  check_ports(running, config, findings);
  judge_disk(measure_disk(config.data_dir), config, findings);
  judge_file_system(config::unsuitable_file_system(config.data_dir), config, findings);
  clock.recorded_us = check_database(config.database(), findings);
  judge_clock(clock, findings);
  check_robots(config.database(), running, clock.now_us, findings);
  check_permissions(config, findings);
  check_certificate(config, clock.now_us, findings);
  check_real_time(running, config, findings);
  check_limits(running, config, findings);
  return findings;
}

void write_findings(std::ostream& out, const Findings& findings) {
  for (const Finding& finding : findings.all()) {
    fmt::print(out, "{:<8} {:<12} {}\n", text(finding.grade), finding.topic, finding.what);
    if (!finding.action.empty()) fmt::print(out, "{:21} -> {}\n", "", finding.action);
  }
  if (findings.problems() == 0) fmt::print(out, "nothing is wrong\n");
}

nlohmann::ordered_json json_of(const Findings& findings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& finding : findings.all()) {
    list.push_back({{"grade", text(finding.grade)},
                    {"topic", finding.topic},
                    {"what", finding.what},
                    {"action", finding.action.empty() ? nlohmann::ordered_json(nullptr)
                                                      : nlohmann::ordered_json(finding.action)}});
  }
  return {{"healthy", findings.problems() == 0}, {"version", base::version()}, {"findings", std::move(list)}};
}

void add_options(CLI::App& command, Doctor& options) {
  command.add_option("--data", options.flags.data_dir, "Folder of the station (default: rheonaut-data)")
      ->check(named());
  command.add_option("--config", options.flags.file, "Configuration that the station is started with")->check(named());
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut doctor --data ~/lab");
}

int run(const Doctor& options, std::ostream& out) {
  const Findings findings = examine(options.flags);
  if (options.form.is_json) {
    write_json(out, json_of(findings));
  } else {
    write_findings(out, findings);
  }
  const std::size_t problems = findings.problems();
  if (problems == 0) return 0;
  return not_done(kFailed, problems == 1 ? "1 thing is wrong" : fmt::format("{} things are wrong", problems));
}

}  // namespace server::cli
