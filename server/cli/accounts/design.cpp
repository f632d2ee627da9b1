// One subcommand an act, each one request to the station.
#include "server/cli/accounts/design.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <limits>
#include <stdexcept>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr const char* kDesigns = "/api/v1/designs";

CLI::App* offer(CLI::App& command, DesignCommand& options, DesignCommand::Act act, const char* name,
                const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

CLI::Validator a_number() { return whole(1, std::numeric_limits<std::int64_t>::max()); }

CLI::Option* offer_kind(CLI::App* sub, DesignCommand& options) {
  return sub->add_option("--kind", options.kind, "model or controller")->check(CLI::IsMember({"model", "controller"}));
}

json ask(const DesignCommand& options, const std::string& method, const std::string& target,
         const json& body = nullptr) {
  const StationAnswer answer = StationClient{options.data_dir}.ask(method, target, body);
  if (answer.status == 200 || answer.status == 201) return answer.body;
  throw std::runtime_error{fmt::format("the station refused: {}", answer.body.value("detail", "no reason"))};
}

json read_document(const std::filesystem::path& file) {
  json document = read_json(file.string());
  if (document.is_object()) return document;
  throw std::runtime_error{
      fmt::format("'{}' is not a JSON object, as `rheonaut identify --json` writes it", file.string())};
}

std::string id_text(const json& id) { return id.is_null() ? "-" : fmt::format("{}", id.get<std::int64_t>()); }

std::string runs_text(const json& design) {
  std::vector<std::int64_t> runs;
  for (const json& source : design.at("runs")) runs.push_back(source.at("run_id").get<std::int64_t>());
  return runs.empty() ? "-" : fmt::format("{}", fmt::join(runs, ","));
}

int list(const DesignCommand& options, std::ostream& out) {
  std::string target = kDesigns;
  if (!options.kind.empty()) target += "?kind=" + options.kind;
  if (!options.runs.empty()) {
    target += fmt::format("{}run_id={}", options.kind.empty() ? "?" : "&", options.runs.front());
  }
  const json designs = ask(options, "GET", target).at("designs");
  if (options.json) {
    fmt::print(out, "{}\n", designs.dump(2));
    return 0;
  }
  Table table{{"id", "<kind", "<name", "parent", "<runs", "<made", "<by"}};
  for (const json& design : designs) {
    table.row({id_text(design.at("design_id")), design.at("kind"), design.at("name"), id_text(design.at("parent_id")),
               runs_text(design), time_text(design.at("made_at_us")), design.at("made_by")});
  }
  table.write(out);
  return 0;
}

int save(const DesignCommand& options, std::ostream& out) {
  if (options.file.has_value() == options.job.has_value()) {
    throw UsageError{"give one of FILE, what a tool printed, and --job, whose result is to be kept"};
  }
  json body{{"kind", options.kind}, {"name", options.name}};
  if (!options.notes.empty()) body["notes"] = options.notes;
  if (options.file) body["document"] = read_document(*options.file);
  if (options.job) body["job_id"] = *options.job;
  if (options.parent) body["parent_id"] = *options.parent;
  if (options.model) body["model_id"] = *options.model;
  for (const std::int64_t run : options.runs) body["runs"].push_back({{"run_id", run}});
  const json design = ask(options, "POST", kDesigns, body);
  if (options.json) {
    fmt::print(out, "{}\n", design.dump(2));
  } else {
    fmt::print(out, "{} {} is kept as '{}'\n", options.kind, id_text(design.at("design_id")), options.name);
  }
  return 0;
}

int show(const DesignCommand& options, std::ostream& out) {
  const bool is_export = options.act == DesignCommand::Act::export_document;
  const json answer =
      ask(options, "GET", fmt::format("{}/{}{}", kDesigns, options.designs.front(), is_export ? "/document" : ""));
  fmt::print(out, "{}\n", answer.dump(2));
  return 0;
}

std::string number_text(const json& value, const char* format) {
  return value.is_null() ? "-" : fmt::format(fmt::runtime(format), value.get<double>());
}

int compare(const DesignCommand& options, std::ostream& out) {
  const json answer =
      ask(options, "GET", fmt::format("/api/v1/design-comparison?ids={}", fmt::join(options.designs, ",")));
  if (options.json) {
    fmt::print(out, "{}\n", answer.dump(2));
    return 0;
  }
  const auto is_at_bound = [](const json& at_bound) { return at_bound == true; };
  std::vector<std::string> head{"<parameter", "design", "value", "one sigma", "difference (%)", "in sigmas"};
  const bool has_bound = std::ranges::any_of(answer.at("parameters"), [&](const json& parameter) {
    return std::ranges::any_of(parameter.at("at_bound"), is_at_bound);
  });
  if (has_bound) head.emplace_back("<that sigma");
  Table table{std::move(head)};
  for (const json& parameter : answer.at("parameters")) {
    for (std::size_t i = 0; i < answer.at("designs").size(); ++i) {
      const json& relative = parameter.at("relative_to_first")[i];
      std::vector<std::string> row{i == 0 ? parameter.at("name").get<std::string>() : "",
                                   id_text(answer.at("designs")[i].at("design_id")),
                                   number_text(parameter.at("values")[i], "{:.6g}"),
                                   number_text(parameter.at("one_sigma")[i], "{:.2g}"),
                                   relative.is_null() ? "-" : fmt::format("{:.2f}", 100 * relative.get<double>()),
                                   number_text(parameter.at("sigmas_from_first")[i], "{:.1f}")};
      if (has_bound) row.emplace_back(is_at_bound(parameter.at("at_bound")[i]) ? kSigmaAtBound : "");
      table.row(std::move(row));
    }
  }
  table.write(out);
  for (std::size_t i = 1; i < answer.at("designs").size(); ++i) {
    const json& together = answer.at("together")[i];
    if (together.is_null()) continue;
    fmt::print(out,
               "all parameters of design {} together, from those of the first: chi-square {:.3g} with {} degrees of "
               "freedom, p = {:.2g}\n",
               id_text(answer.at("designs")[i].at("design_id")), together.at("chi_square").get<double>(),
               together.at("degrees_of_freedom").get<int>(), together.at("p").get<double>());
  }
  return 0;
}

void add_save(CLI::App& command, DesignCommand& options) {
  CLI::App* sub = offer(command, options, DesignCommand::Act::save, "save", "Keep a model or a controller");
  auto* file = sub->add_option(
      "file", options.file, "What identify --json or tune --json printed, or the parameters alone; -: standard input");
  file->check(named());
  sub->add_option("--job", options.job, "Instead of a file, the result of this job")->check(a_number())->excludes(file);
  offer_kind(sub, options)->required();
  sub->add_option("--name", options.name, "For lists")->required()->check(named());
  sub->add_option("--notes", options.notes, "What else is to be said of it");
  sub->add_option("--parent", options.parent, "The design that it is a change of")->check(a_number());
  sub->add_option("--model", options.model, "Of a controller: the model that it is designed for")->check(a_number());
  sub->add_option("--run", options.runs, "A run that it was found from; may be given several times")->check(a_number());
  sub->add_flag("--json", options.json, "As JSON");
  sub->footer("Example: rheonaut design save fit.json --kind model --name softener --run 1 --data lab");
}

}  // namespace

void add_options(CLI::App& command, DesignCommand& options) {
  command.require_subcommand(1);
  CLI::App* listed = offer(command, options, DesignCommand::Act::list, "list", "List them, newest first");
  offer_kind(listed, options);
  listed->add_option("--run", options.runs, "Only those found from this run")->expected(1)->check(a_number());
  listed->add_flag("--json", options.json, "As JSON");
  add_save(command, options);
  const auto offer_one = [&](DesignCommand::Act act, const char* name, const char* purpose) {
    offer(command, options, act, name, purpose)
        ->add_option("design", options.designs, "Its number")
        ->required()
        ->expected(1)
        ->check(a_number());
  };
  offer_one(DesignCommand::Act::show, "show", "Show one with its document and its ancestors, as JSON");
  offer_one(DesignCommand::Act::export_document, "export", "Print its document, which the tools read");
  CLI::App* compared = offer(command, options, DesignCommand::Act::compare, "compare", "Show parameters side by side");
  compared->add_option("designs", options.designs, "Their numbers, the first is what the others are compared with")
      ->required()
      ->expected(2, 20)
      ->check(a_number());
  compared->add_flag("--json", options.json, "As JSON");
  command.footer("Example: rheonaut design list --data lab");
}

int run(const DesignCommand& options, std::ostream& out) {
  switch (options.act) {
    case DesignCommand::Act::list: return list(options, out);
    case DesignCommand::Act::save: return save(options, out);
    case DesignCommand::Act::show:
    case DesignCommand::Act::export_document: return show(options, out);
    case DesignCommand::Act::compare: return compare(options, out);
  }
  return 0;
}

}  // namespace server::cli
