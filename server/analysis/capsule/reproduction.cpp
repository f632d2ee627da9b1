// The files first, then the numbers, then the plots.
#include "server/analysis/capsule/reproduction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "base/json_text.hpp"
#include "base/nesting.hpp"
#include "server/analysis/capsule/capsule_samples.hpp"
#include "server/analysis/capsule/crate_metadata.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/analysis/report/run_report.hpp"

namespace server::analysis {
namespace {

using nlohmann::json;

constexpr std::size_t kMostCrateBytes = 16'000'000, kMostDocumentBytes = 64'000'000;
constexpr std::size_t kMostSamples = 10'000'000;
constexpr std::size_t kMostFaults = 100;
constexpr const char* kSamplesFile = "samples.sqlite";
constexpr const char* kMetricsFile = "metrics.json";
constexpr const char* kRunFile = "run.json";
constexpr const char* kReportFile = "report.html";

// The archive with the one folder that it has.
struct Crate {
  ArchiveReader& archive;
  std::string folder;  // "run-7/"
  json graph;
  std::string samples = {};  // the bytes of samples.sqlite

  Result<std::string> text(const char* name) const { return archive.text(folder + name, kMostDocumentBytes); }
};

// Discarded: it is no JSON, or nested so deep that nobody meant it.
json parse_foreign(const std::string& text) {
  if (base::is_json_deeper(text, base::kMostJsonDepth)) return json::value_t::discarded;
  return json::parse(text, nullptr, false);
}

Result<Crate> open_crate(ArchiveReader& archive) {
  for (const std::string& name : archive.names()) {
    const std::size_t slash = name.find('/');
    if (slash == std::string::npos || name.substr(slash + 1) != kCrateFile) continue;
    const auto text = archive.text(name, kMostCrateBytes);
    if (!text) return std::unexpected{text.error()};
    const json document = parse_foreign(*text);
    if (!document.is_object() || !document.contains("@graph") || !document.at("@graph").is_array()) {
      return fail(ErrorCode::invalid, fmt::format("{} is not RO-Crate metadata", name));
    }
    return Crate{archive, name.substr(0, slash + 1), document.at("@graph")};
  }
  return fail(ErrorCode::invalid, fmt::format("the archive has no {} in its folder", kCrateFile));
}

std::string member_of(const json& entity, const char* name) {
  const bool is_text = entity.is_object() && entity.contains(name) && entity.at(name).is_string();
  return is_text ? entity.at(name).get<std::string>() : std::string{};
}

// Samples are kept on the way, for the mathematics.
void check_file(Crate& crate, const json& entity, Reproduction& found) {
  const std::string name = member_of(entity, "@id"), expected = member_of(entity, "sha256");
  ++found.files;
  const auto sum = crate.archive.read(crate.folder + name, [&](const std::string& piece) {
    if (name == kSamplesFile) crate.samples += piece;
  });
  if (!sum) {
    found.faults.push_back(sum.error().detail);
  } else if (*sum != expected) {
    found.faults.push_back(fmt::format("{}{} has SHA-256 {}, the crate says {}", crate.folder, name, *sum,
                                       expected.empty() ? "none" : expected));
  }
}

void check_files(Crate& crate, Reproduction& found) {
  std::set<std::string> described{crate.folder + kCrateFile};
  for (const json& entity : crate.graph) {
    if (member_of(entity, "@type") != "File") continue;
    const std::string name = crate.folder + member_of(entity, "@id");
    if (!described.insert(name).second) {  // each is unpacked once
      found.faults.push_back(fmt::format("{} is in the crate's metadata twice", name));
      return;
    }
    check_file(crate, entity, found);
    if (found.faults.size() > kMostFaults) return;
  }
  for (const std::string& name : crate.archive.names()) {
    if (!described.contains(name)) found.faults.push_back(fmt::format("{} is not in the crate's metadata", name));
  }
  found.seal = crate.archive.seal();
  if (found.seal == Seal::broken && found.faults.empty()) {
    found.faults.emplace_back("the archive itself is changed between its files: its SHA-256 is not the one at its end");
  }
}

void read_maker(const Crate& crate, Reproduction& found) {
  for (const json& entity : crate.graph) {
    if (member_of(entity, "@id") != "#rheonaut") continue;
    found.program = member_of(entity, "softwareVersion");
    found.architecture = member_of(entity, "processorRequirements");
  }
}

bool is_near(double a, double b) { return std::abs(a - b) <= kReproducedWithin * std::max(std::abs(a), std::abs(b)); }

Agreement agreement_of_values(const json& stored, const json& recomputed) {
  if (stored == recomputed) return Agreement::bit_for_bit;
  if (!stored.is_number() || !recomputed.is_number()) return Agreement::different;
  return is_near(stored.get<double>(), recomputed.get<double>()) ? Agreement::within_tolerance : Agreement::different;
}

// By their place in the document, without the slash before it.
void compare_metrics(json stored, const json& recomputed, std::vector<Reproduced>& results) {
  for (const char* about : {"version", "program"}) stored.erase(about);
  const json before = stored.flatten(), now = recomputed.flatten();
  std::set<std::string> places;
  for (const json& document : {before, now}) {
    for (const auto& [place, value] : document.items()) places.insert(place);
  }
  for (const std::string& place : places) {
    const json was = before.contains(place) ? before.at(place) : json("-");
    const json is = now.contains(place) ? now.at(place) : json("-");
    results.push_back({place.empty() ? "the document" : place.substr(1), agreement_of_values(was, is), base::dump(was),
                       base::dump(is)});
  }
}

// The plots of a report by their titles.
std::map<std::string, std::string> plots_in(const std::string& html) {
  constexpr std::string_view kTitle = "class=\"title\">";
  std::map<std::string, std::string> plots;
  const std::string_view text = html;
  for (std::size_t from = text.find("<svg"); from != std::string::npos; from = text.find("<svg", from)) {
    const std::size_t to = text.find("</svg>", from);
    if (to == std::string::npos) break;
    const std::string_view plot = text.substr(from, to - from);
    from = to;
    const std::size_t title = plot.find(kTitle);
    if (title == std::string::npos) continue;
    const std::size_t words = title + kTitle.size();
    plots[std::string{plot.substr(words, plot.find('<', words) - words)}] = plot;
  }
  return plots;
}

void compare_plots(const std::string& stored, const std::string& recomputed, std::vector<Reproduced>& results) {
  auto before = plots_in(stored), now = plots_in(recomputed);
  std::set<std::string> titles;
  for (const auto& [title, plot] : before) titles.insert(title);
  for (const auto& [title, plot] : now) titles.insert(title);
  for (const std::string& title : titles) {
    const auto words = [&](auto& plots) { return plots.contains(title) ? "drawn" : "-"; };
    results.push_back({"plot: " + title, agreement_of(before[title], now[title]), words(before), words(now)});
  }
}

Result<json> document_in(const Crate& crate, const char* name) {
  const auto text = crate.text(name);
  if (!text) return std::unexpected{text.error()};
  json document = parse_foreign(*text);
  if (document.is_object()) return document;
  return fail(ErrorCode::invalid, fmt::format("{} is not a JSON object", name));
}

// Of the run, what figures are counted against.
storage::Run counted_run(const json& document) {
  storage::Run run;
  run.samples_expected = document.value("samples_expected", std::uint64_t{0});
  run.samples_lost = document.value("samples_lost", std::uint64_t{0});
  const json missed = document.value("missed_ticks", json{}), longest = document.value("longest_missed_ticks", json{});
  if (missed.is_number_unsigned() && longest.is_number_unsigned()) {
    run.missed = storage::MissedTicks{missed.get<std::uint64_t>(), longest.get<std::uint64_t>()};
  }
  for (const json& part : document.value("interrupted", json::array())) {  // none of version 0.9.0
    const auto number = [&part](const char* name) {
      const json value = part.is_object() ? part.value(name, json{}) : json{};
      return value.is_number_unsigned() ? value.get<std::uint64_t>() : 0;
    };
    run.interrupted.push_back({static_cast<std::uint32_t>(number("span")), number("from_robot_time_us"),
                               number("to_robot_time_us"), member_of(part, "reason"), member_of(part, "detail")});
  }
  return run;
}

RunMetrics metrics_of(const CapsuleSamples& read, const storage::Run& run) {
  std::vector<RunPoint> points;
  std::vector<StepPoint> steps;
  for (const storage::StoredSample& stored : read.samples) {
    points.push_back(run_point(stored));
    steps.push_back(points.back().step);
  }
  return {run_figures(points, run), measures_of(steps, read.reference)};
}

Result<void> recompute(Crate& crate, Reproduction& found) {
  const auto run = document_in(crate, kRunFile), metrics = document_in(crate, kMetricsFile);
  if (!run) return std::unexpected{run.error()};
  if (!metrics) return std::unexpected{metrics.error()};
  const auto html = crate.text(kReportFile);
  if (!html) return std::unexpected{html.error()};
  auto samples = read_capsule_samples(crate.samples, kMostSamples);
  if (!samples) return std::unexpected{samples.error()};
  RunReport report;
  const storage::Run counted = counted_run(*run);
  report.run.interrupted = counted.interrupted;
  report.metrics = json::parse(base::dump(json_of(metrics_of(*samples, counted))));
  const bool has_missed = metrics->contains(json::json_pointer{"/figures/missed_ticks"});  // not of version 0.9.0
  if (has_missed) add_missed_ticks(report.metrics, counted);
  compare_metrics(*metrics, report.metrics, found.results);
  for (const storage::StoredSample& stored : samples->samples) report.trace.push_back(trace_point(stored));
  report.reference = std::move(samples->reference);
  compare_plots(*html, html_of(report), found.results);
  return {};
}

// A number from here on, and what stands before it.
struct Token {
  std::string_view words;
  std::optional<double> number;
};

Token next_token(std::string_view& text) {
  for (std::size_t at = 0; at < text.size(); ++at) {
    double number = 0;
    const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), number);
    if (error == std::errc::invalid_argument) continue;
    if (error != std::errc{}) {  // beyond every double: words, as a whole
      at = static_cast<std::size_t>(end - text.data()) - 1;
      continue;
    }
    const Token token{text.substr(0, at), number};
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    return token;
  }
  return {std::exchange(text, {}), std::nullopt};
}

}  // namespace

const char* text(Agreement value) {
  switch (value) {
    case Agreement::bit_for_bit: return "bit for bit";
    case Agreement::within_tolerance: return "within 1e-9";
    case Agreement::different: return "different";
  }
  return "";
}

Agreement agreement_of(const std::string& stored, const std::string& recomputed) {
  if (stored == recomputed) return Agreement::bit_for_bit;
  std::string_view a = stored, b = recomputed;
  while (!a.empty() && !b.empty()) {
    const Token one = next_token(a), other = next_token(b);
    if (one.words != other.words || one.number.has_value() != other.number.has_value()) return Agreement::different;
    if (one.number && !is_near(*one.number, *other.number)) return Agreement::different;
  }
  return a.empty() && b.empty() ? Agreement::within_tolerance : Agreement::different;
}

bool Reproduction::is_reproduced() const {
  const auto differs = [](const Reproduced& result) { return result.agreement == Agreement::different; };
  return faults.empty() && std::ranges::none_of(results, differs);
}

Result<Reproduction> reproduce(const std::filesystem::path& archive) {
  ArchiveReader reader{archive};
  Reproduction found;
  if (std::string fault = reader.fault_of_names(); !fault.empty()) {
    found.faults.push_back(std::move(fault));
    return found;
  }
  auto crate = open_crate(reader);
  if (!crate) {
    if (crate.error().reason != "damaged") return std::unexpected{crate.error()};
    found.faults.push_back(crate.error().detail);
    return found;
  }
  read_maker(*crate, found);
  check_files(*crate, found);
  if (!found.faults.empty()) return found;
  if (const auto done = recompute(*crate, found); !done) return std::unexpected{done.error()};
  return found;
}

}  // namespace server::analysis
