// `rheonaut verify`.
#include "server/cli/verify.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <limits>

#include "server/cli/options.hpp"
#include "server/recording/run_reader.hpp"
#include "server/recording/schema.hpp"
#include "server/recording/store_check.hpp"

namespace server::cli {
namespace {

constexpr int kFaults = 1;
constexpr int kUnreadable = 2;

struct Verified {
  StoreFindings findings;
  bool integrity_checked = false;
};

// A run alone is not worth reading every page for; nor is it done unasked beside a station, whose log would grow.
Result<Verified> verify_file(const std::filesystem::path& path, const Verify& wish) {
  Verified verified;
  auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    const auto version = database.execAndGet("PRAGMA user_version").getInt64();
    if (version < static_cast<std::int64_t>(migrations().size())) {
      return fail(ErrorCode::invalid, fmt::format("{} has schema version {}, which knows no certificates; a station "
                                                  "brings it up to date when it opens it",
                                                  path.string(), version));
    }
    const StoreCheck check{wish.run, wish.integrity || (!wish.run && lock_is_free(path))};
    auto findings = check_store(database, check);
    if (!findings) return std::unexpected{findings.error()};
    verified = {std::move(*findings), check.integrity};
    return {};
  };
  auto done = read_store(path, read);
  if (!done) return std::unexpected{done.error()};
  return verified;
}

void write_table(std::ostream& out, const Verified& verified, const Verify& wish) {
  const StoreFindings& findings = verified.findings;
  for (const std::string& fault : findings.faults) fmt::print(out, "fault: {}\n", one_line(fault));
  fmt::print(out, "segments  {} with {} samples\n", findings.segments, findings.samples);
  fmt::print(out, "runs      {} verified, {} with samples on their way, {} not certified yet\n", findings.runs_verified,
             findings.runs_incomplete, findings.runs_uncertified);
  if (!verified.integrity_checked && !wish.run) {
    fmt::print(out,
               "skipped   SQLite's integrity check, since a station runs: its log would grow meanwhile; "
               "--integrity makes it\n");
  }
  fmt::print(out, "{}\n", findings.faults.empty() ? "no faults" : fmt::format("{} faults", findings.faults.size()));
}

nlohmann::ordered_json json_of(const Verified& verified) {
  const StoreFindings& findings = verified.findings;
  nlohmann::ordered_json out;
  out["faults"] = findings.faults;
  out["segments"] = findings.segments;
  out["samples"] = findings.samples;
  out["runs_verified"] = findings.runs_verified;
  out["runs_incomplete"] = findings.runs_incomplete;
  out["runs_uncertified"] = findings.runs_uncertified;
  out["integrity_checked"] = verified.integrity_checked;
  return out;
}

}  // namespace

void add_options(CLI::App& command, Verify& wish) {
  auto* data = command.add_option("--data", wish.data_dir, "Folder of the station (default: rheonaut-data)");
  data->check(named());
  command.add_option("--file", wish.file, "This database, e.g. a backup, and not the folder's")
      ->check(named())
      ->excludes(data);
  command.add_option("--run", wish.run, "Only this run: its samples and its certificate")
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_flag("--integrity", wish.integrity,
                   "SQLite's own check of every page also while a station runs, whose log grows meanwhile");
  add_json_flag(command, wish.form);
  command.footer("Example: rheonaut verify --data ~/lab");
}

int run(const Verify& wish, std::ostream& out) {
  const auto verified = verify_file(wish.file.value_or(wish.data_dir / "station.sqlite"), wish);
  if (!verified) {
    fmt::print(stderr, "rheonaut: {}\n", one_line(verified.error().detail));
    return kUnreadable;
  }
  if (wish.form.is_json) {
    write_json(out, json_of(*verified));
  } else {
    write_table(out, *verified, wish);
  }
  return verified->findings.faults.empty() ? 0 : kFaults;
}

}  // namespace server::cli
