// `rheonaut verify`.
#include "server/cli/data/verify.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <limits>

#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/database/foreign_file.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/upkeep/audit_check.hpp"
#include "server/storage/upkeep/store_check.hpp"
#include "server/storage/upkeep/store_head.hpp"

namespace server::cli {
namespace {

constexpr int kFaults = 1;
constexpr int kUnreadable = 2;

struct Verified {
  std::vector<std::string> losses;  // what the head file beside the database names and the database has not
  std::optional<storage::StoreFindings> store;
  bool integrity_checked = false;
  std::optional<storage::AuditFindings> audit;

  std::vector<std::string> faults() const {
    std::vector<std::string> all = losses;
    if (store) all.insert(all.end(), store->faults.begin(), store->faults.end());
    if (audit) all.insert(all.end(), audit->faults.begin(), audit->faults.end());
    return all;
  }
};

// The head file is read first, for beside a station that runs the database moves on.
std::vector<std::string> find_losses(SQLite::Database& database, const Result<std::optional<storage::HeadFile>>& head) {
  if (!head) return {head.error().detail};
  if (!*head) return {};
  std::vector<std::string> losses;
  for (const storage::StoreLoss& loss : (*head)->losses) losses.push_back("not acknowledged: " + loss.problem);
  if (auto loss = find_loss(database, **head)) losses.push_back(std::move(*loss));
  return losses;
}

// A run alone is not worth reading every page for; nor is it done unasked beside a station, whose log would grow.
Result<Verified> verify_file(const std::filesystem::path& path, const Verify& options) {
  Verified verified;
  auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    verified = {};
    storage::guard_foreign(database);
    const auto version = database.execAndGet("PRAGMA user_version").getInt64();
    if (version < static_cast<std::int64_t>(storage::migrations().size())) {
      return fail(ErrorCode::invalid, fmt::format("{} has schema version {}, which this program cannot verify; a "
                                                  "station brings it up to date when it opens it",
                                                  path.string(), version));
    }
    if (!options.run) {
      verified.losses = find_losses(database, storage::load_head_file(path));
      verified.audit = check_audit(database, options.expected);
    }
    if (options.audit) return {};
    const storage::StoreCheck check{options.run, options.integrity || (!options.run && storage::lock_is_free(path))};
    auto findings = check_store(database, check);
    if (!findings) return std::unexpected{findings.error()};
    verified.store = std::move(*findings);
    verified.integrity_checked = check.integrity;
    return {};
  };
  auto done = storage::read_store(path, read);
  if (!done) return std::unexpected{done.error()};
  return verified;
}

bool is_export(const std::filesystem::path& path) {
  try {
    SQLite::Database file{storage::reading_uri(path, true),
                          SQLite::OPEN_READONLY | SQLite::OPEN_URI};  // makes no files beside it
    return file.execAndGet("PRAGMA application_id").getInt64() == storage::kRunFileApplicationId;
  } catch (const SQLite::Exception&) {  // whatever it is, reading it says so
    return false;
  }
}

Result<Verified> verify_export(const std::filesystem::path& path, const Verify& options) {
  if (!options.audit) {
    return fail(ErrorCode::invalid,
                fmt::format("{} is the export of a run; --audit verifies the audit in it", path.string()));
  }
  try {
    SQLite::Database file = storage::open_for_reading(path);
    storage::guard_foreign(file);
    if (file.execAndGet("PRAGMA user_version").getInt64() < storage::kRunFileAuditSince) {
      return fail(ErrorCode::invalid,
                  fmt::format("{} was exported by an earlier version: no audit is in it", path.string()));
    }
    Verified verified;
    verified.audit = check_exported_audit(file, options.expected);
    return verified;
  } catch (const SQLite::Exception& error) {
    return fail(ErrorCode::unavailable, fmt::format("cannot read {}: {}", path.string(), runtime::text_of(error)));
  }
}

void write_table(std::ostream& out, const Verified& verified, const Verify& options) {
  const std::vector<std::string> faults = verified.faults();
  for (const std::string& fault : faults) fmt::print(out, "fault: {}\n", one_line(fault));
  if (verified.store) {
    const storage::StoreFindings& findings = *verified.store;
    fmt::print(out, "segments  {} with {} samples\n", findings.segments, findings.samples);
    fmt::print(out, "runs      {} verified, {} with samples on their way, {} not certified yet\n",
               findings.runs_verified, findings.runs_incomplete, findings.runs_without_digest);
  }
  if (verified.audit) {
    const storage::AuditFindings& findings = *verified.audit;
    const std::string hidden = findings.hidden == 0 ? "" : fmt::format(" ({} as hashes only)", findings.hidden);
    fmt::print(out, "audit     {} entries{}, {} commands agree with it\n", findings.entries, hidden, findings.commands);
    fmt::print(out, "head      {}\n", findings.head.entry == 0 ? "-" : text(findings.head));
  }
  if (verified.store && !verified.integrity_checked && !options.run) {
    fmt::print(
        out,
        "skipped   SQLite's integrity check, and of the extremes kept for overviews, since a station runs: its log "
        "would grow meanwhile; --integrity makes them\n");
  }
  fmt::print(out, "{}\n", faults.empty() ? "no faults" : fmt::format("{} faults", faults.size()));
}

nlohmann::ordered_json json_of(const Verified& verified) {
  nlohmann::ordered_json out;
  out["faults"] = verified.faults();
  if (verified.store) {
    const storage::StoreFindings& findings = *verified.store;
    out["segments"] = findings.segments;
    out["samples"] = findings.samples;
    out["runs_verified"] = findings.runs_verified;
    out["runs_incomplete"] = findings.runs_incomplete;
    out["runs_uncertified"] = findings.runs_without_digest;
    out["integrity_checked"] = verified.integrity_checked;
  }
  if (verified.audit) {
    const storage::AuditFindings& findings = *verified.audit;
    out["audit_entries"] = findings.entries;
    out["audit_hidden"] = findings.hidden;
    out["audit_commands"] = findings.commands;
    out["audit_head"] =
        findings.head.entry == 0 ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text(findings.head));
  }
  return out;
}

}  // namespace

void add_options(CLI::App& command, Verify& options) {
  auto* data = command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)");
  data->check(named());
  command.add_option("--file", options.file, "This database, e.g. a backup, and not the folder's")
      ->check(named())
      ->excludes(data);
  auto* run = command.add_option("--run", options.run, "Only this run: its samples and its certificate")
                  ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_flag("--integrity", options.integrity,
                   "SQLite's own check of every page also while a station runs, whose log grows meanwhile");
  auto* audit = command.add_flag("--audit", options.audit, "Only the audit; --file may name the export of a run");
  audit->excludes(run);
  const auto expect = [&options](const std::string& given) {
    const auto head = storage::parse_audit_head(given);
    if (!head) throw CLI::ValidationError{"--expect", head.error().detail};
    options.expected = *head;
  };
  command
      .add_option_function<std::string>("--expect", expect,
                                        "ENTRY:HASH of the audit as it once was, from the log or an earlier verify")
      ->excludes(run);
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut verify --data ~/lab");
}

int run(const Verify& options, std::ostream& out) {
  const std::filesystem::path path = options.file.value_or(options.data_dir / "station.sqlite");
  const Progress progress{"verify", options.form};
  const auto verified = is_export(path) ? verify_export(path, options) : verify_file(path, options);
  if (!verified) {
    fmt::print(stderr, "rheonaut: {}\n", one_line(verified.error().detail));
    return kUnreadable;
  }
  if (options.form.is_json) {
    write_json(out, json_of(*verified));
  } else {
    write_table(out, *verified, options);
  }
  const std::size_t faults = verified->faults().size();
  if (faults == 0) return 0;
  return not_done(kFaults, fmt::format("{}: {} fault{} found", path.string(), faults, faults == 1 ? "" : "s"));
}

}  // namespace server::cli
