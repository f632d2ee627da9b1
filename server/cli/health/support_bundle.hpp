// `rheonaut support-bundle`: one zip file with what helps others to help, and without secrets.
//
//   README.txt            what is in it, and that one should look through it
//   doctor.txt, .json     what `rheonaut doctor` finds
//   versions.json         program, schema, libraries, system
//   config.json           the configuration in force, without names and paths of keys
//   metrics.txt           of the running station
//   schema.sql, tables.json   the tables, and how many rows they have
//   parameters.json       of each robot, as it reported them last
//   events.jsonl          of the last day, 20000 at most
//   log.txt               its last lines, from --log FILE or the journal of the systemd unit rheonaut
// Every text of a peer passes Redaction. Errors: throws std::runtime_error when it cannot be written; what cannot be
// gathered is said in the file where it would stand.
#pragma once

#include <filesystem>
#include <optional>
#include <ostream>

#include "server/cli/terminal/output.hpp"
#include "server/config/config.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct SupportBundle {
  config::ConfigFlags flags;  // file and data_dir only
  std::filesystem::path to;
  std::optional<std::filesystem::path> log;
  OutputForm form;
};

void add_options(CLI::App& command, SupportBundle& options);

// 0 when it is written.
int run(const SupportBundle& options, std::ostream& out);

}  // namespace server::cli
