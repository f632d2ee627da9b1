// One entity each for the descriptor, the run, its files, the programs and the people.
#include "server/analysis/capsule/crate_metadata.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/utsname.h>

#include <ctime>
#include <nlohmann/json.hpp>

namespace server::analysis {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kProfile = "https://w3id.org/ro/crate/1.1";
constexpr const char* kContext = "https://w3id.org/ro/crate/1.1/context";

std::string iso_text(std::int64_t at_us) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(at_us / 1'000'000)));
}

Json id_of(const std::string& id) { return {{"@id", id}}; }

Json descriptor() {
  return {{"@id", kCrateFile},
          {"@type", "CreativeWork"},
          {"about", id_of("./")},
          {"conformsTo", id_of(kProfile)},
          {"sdPublisher", id_of("#rheonaut")}};
}

std::string description_of(const storage::Run& run) {
  const storage::RunConditions& said = run.conditions;
  std::string text = fmt::format("Run {} of robot {}", run.id, run.robot_id);
  if (!said.fluid.empty()) text += ", in " + said.fluid;
  if (!said.profile.empty()) text += ", " + said.profile;
  text += fmt::format(": {} samples.", run.samples_stored);
  for (const std::string* more : {&said.notes, &said.verdict}) {
    if (!more->empty()) text += " " + *more;
  }
  return text;
}

Json root(const CrateSubject& subject, std::span<const CrateFile> files) {
  const storage::Run& run = subject.run;
  Json parts = Json::array();
  for (const CrateFile& file : files) parts.push_back(id_of(file.file.name));
  Json entity = {{"@id", "./"},
                 {"@type", "Dataset"},
                 {"name", run.conditions.name},
                 {"description", description_of(run)},
                 {"datePublished", iso_text(run.ended_at_us.value_or(run.started_at_us))},
                 {"identifier", fmt::format("{}/{}", run.robot_id, run.id)},
                 {"license", id_of("#licence")},
                 {"hasPart", std::move(parts)},
                 {"mentions", id_of("#run")}};
  if (!run.conditions.operator_name.empty()) entity["author"] = id_of("#operator");
  return entity;
}

Json entity_of(const CrateFile& file) {
  return {{"@id", file.file.name},
          {"@type", "File"},
          {"name", file.title},
          {"encodingFormat", file.media_type},
          {"contentSize", fmt::format("{}", file.file.bytes)},
          {"sha256", file.file.sha256}};
}

// What happened, and with which programs.
Json action(const storage::Run& run, std::span<const CrateFile> files) {
  Json results = Json::array();
  for (const CrateFile& file : files) results.push_back(id_of(file.file.name));
  Json entity = {{"@id", "#run"},
                 {"@type", "CreateAction"},
                 {"name", run.conditions.name},
                 {"startTime", iso_text(run.started_at_us)},
                 {"instrument", Json::array({id_of("#rheonaut"), id_of("#firmware")})},
                 {"result", std::move(results)}};
  if (run.ended_at_us) entity["endTime"] = iso_text(*run.ended_at_us);
  if (!run.conditions.operator_name.empty()) entity["agent"] = id_of("#operator");
  return entity;
}

}  // namespace

std::string crate_json(const CrateSubject& subject, std::span<const CrateFile> files) {
  const storage::Run& run = subject.run;
  Json graph = Json::array({descriptor(), root(subject, files)});
  for (const CrateFile& file : files) graph.push_back(entity_of(file));
  graph.push_back(action(run, files));
  graph.push_back({{"@id", "#rheonaut"},
                   {"@type", "SoftwareApplication"},
                   {"name", "Rheonaut"},
                   {"softwareVersion", subject.program},
                   {"processorRequirements", subject.architecture}});
  graph.push_back({{"@id", "#firmware"},
                   {"@type", "SoftwareApplication"},
                   {"name", "Firmware of the robot"},
                   {"softwareVersion", run.firmware_version}});
  if (!run.conditions.operator_name.empty()) {
    graph.push_back({{"@id", "#operator"}, {"@type", "Person"}, {"name", run.conditions.operator_name}});
  }
  graph.push_back({{"@id", "#licence"},
                   {"@type", "CreativeWork"},
                   {"name", "No licence is stated"},
                   {"description", "The station knows of none: ask those who made the run before it is used."}});
  const Json context = Json::array({kContext, {{"sha256", "http://schema.org/sha256"}}});  // a term that 1.1 lacks
  const Json crate = {{"@context", context}, {"@graph", std::move(graph)}};
  return crate.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string architecture() {
  utsname about{};
  return ::uname(&about) == 0 ? about.machine : "unknown";
}

}  // namespace server::analysis
