// The comparison as a table, or as JSON.
#include "server/cli/data/reproduce.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "base/version.hpp"
#include "server/analysis/capsule/crate_metadata.hpp"
#include "server/analysis/capsule/reproduction.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {
namespace {

using analysis::Agreement;
using analysis::Reproduction;

constexpr int kNotReproduced = 1;
constexpr int kNotAnArchive = 2;

std::size_t count_of(const Reproduction& found, Agreement agreement) {
  return static_cast<std::size_t>(
      std::ranges::count_if(found.results, [&](const auto& result) { return result.agreement == agreement; }));
}

const char* words_of(analysis::Seal seal) {
  switch (seal) {
    case analysis::Seal::whole: return "the archive is as it was written";
    case analysis::Seal::broken: return "the archive is not as it was written";
    case analysis::Seal::none: return "the archive was packed by another program";
  }
  return "";
}

void write_text(std::ostream& out, const Reproduction& found) {
  for (const std::string& fault : found.faults) fmt::print(out, "{}\n", one_line(fault));
  if (!found.faults.empty()) return;
  fmt::print(out, "{} files have the SHA-256 that the crate says; {}\n", found.files, words_of(found.seal));
  fmt::print(out, "made by Rheonaut {} on {}, computed again by Rheonaut {} on {}\n\n", one_line(found.program),
             one_line(found.architecture), base::version(), analysis::architecture());
  Table table{{"<what", "in the archive", "computed again", "<equal"}};
  for (const analysis::Reproduced& result : found.results) {
    table.row({one_line(result.name), one_line(result.stored), one_line(result.recomputed), text(result.agreement)});
  }
  table.write(out);
  fmt::print(out, "\nof {}: {} equal bit for bit, {} within 1e-9, {} different\n", found.results.size(),
             count_of(found, Agreement::bit_for_bit), count_of(found, Agreement::within_tolerance),
             count_of(found, Agreement::different));
}

void write_json(std::ostream& out, const Reproduction& found) {
  nlohmann::ordered_json answer{{"is_reproduced", found.is_reproduced()},
                                {"files", found.files},
                                {"faults", found.faults},
                                {"archive", words_of(found.seal)},
                                {"made_by", found.program},
                                {"made_on", found.architecture},
                                {"computed_by", base::version()},
                                {"computed_on", analysis::architecture()},
                                {"results", nlohmann::ordered_json::array()}};
  for (const analysis::Reproduced& result : found.results) {
    answer["results"].push_back({{"name", result.name},
                                 {"stored", result.stored},
                                 {"computed", result.recomputed},
                                 {"equal", text(result.agreement)}});
  }
  fmt::print(out, "{}\n", answer.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

}  // namespace

void add_options(CLI::App& command, Reproduce& options) {
  command.add_option("file", options.file, "The archive, as `rheonaut capsule` writes it")->required()->check(named());
  add_json_flag(command, options.form);
  command.footer(
      "Exit status 1: a file is damaged, or a number differs; 2: it is no archive of a run.\n"
      "Example: rheonaut reproduce run-1.eln");
}

int run(const Reproduce& options, std::ostream& out) {
  const Progress progress{"reproduce", options.form};
  const auto found = analysis::reproduce(options.file);
  if (!found) {
    fmt::print(stderr, "rheonaut: {}: {}\n", options.file.string(), one_line(found.error().detail));
    return kNotAnArchive;
  }
  if (options.form.is_json) {
    write_json(out, *found);
  } else {
    write_text(out, *found);
  }
  if (found->is_reproduced()) return 0;
  return not_done(kNotReproduced, options.file.string() + ": a file is damaged, or a number differs");
}

}  // namespace server::cli
