// `rheonaut doctor`: looks at a station, its machine and its data folder, and says what is wrong and what to do.
//
// Works with and without a running station; changes nothing (it writes one file of 4 kB into the folder and removes it,
// to see how fast the disk is).
#pragma once

#include <ostream>

#include "server/cli/health/findings.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/config/config.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct Doctor {
  config::ConfigFlags flags;  // file and data_dir only
  OutputForm form;
};

void add_options(CLI::App& command, Doctor& options);

// Everything that is looked at, in the order of the output.
Findings examine(const config::ConfigFlags& flags);
void write_findings(std::ostream& out, const Findings& findings);
nlohmann::ordered_json json_of(const Findings& findings);

// 0: nothing is wrong; 1: something is, see the findings.
int run(const Doctor& options, std::ostream& out);

}  // namespace server::cli
