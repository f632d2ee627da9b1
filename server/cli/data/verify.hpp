// `rheonaut verify`: whether a station's database is what it should be, its digests are true, and its audit is as
// it was written.
#pragma once

#include <filesystem>
#include <optional>
#include <ostream>

#include "server/cli/terminal/output.hpp"
#include "server/storage/audit/audit_chain.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct Verify {
  std::filesystem::path data_dir = "rheonaut-data";
  std::optional<std::filesystem::path> file;   // this one, instead of the folder's
  std::optional<std::int64_t> run;             // only this one
  bool integrity = false;                      // SQLite's own check also beside a running station
  bool audit = false;                          // only the audit, also of a run's export
  std::optional<storage::AuditHead> expected;  // an entry that was in it once
  OutputForm form;
};

void add_options(CLI::App& command, Verify& options);

// 0: all is well; 1: faults, a line each; 2: it cannot be read, the reason is on standard error.
int run(const Verify& options, std::ostream& out);

}  // namespace server::cli
