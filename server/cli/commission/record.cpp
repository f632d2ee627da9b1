// JSON, Markdown, and a folder that is whole or has no sums.
#include "server/cli/commission/record.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "server/runtime/sha256.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kUsPerS = 1'000'000;

std::tm utc_of(std::int64_t at_us) { return fmt::gmtime(static_cast<std::time_t>(at_us / kUsPerS)); }
std::string moment_of(std::int64_t at_us) { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", utc_of(at_us)); }

// In a cell of a table of Markdown.
std::string in_cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.insert(at, "\\");
  std::ranges::replace(text, '\n', ' ');
  return text;
}

std::string cell_of(const Json& value) { return value.is_string() ? value.get<std::string>() : value.dump(); }

// Only of a simulated robot may be said beforehand what a person has to see.
bool is_unwatched(const CommissionRecord& record) {
  const bool is_simulated = record.subject.value("firmware_version", "").starts_with("sim-");
  const bool has_direction = std::ranges::find(record.prepared, "direction") != record.prepared.end();
  return !is_simulated && (record.is_confirmed_beforehand || has_direction);
}

const char* confirmed_by(const CommissionRecord& record) {
  return record.is_confirmed_beforehand ? "nobody: --yes was given beforehand" : "a person, step by step";
}

std::string prepared_text(const CommissionRecord& record) {
  return record.prepared.empty() ? "none" : fmt::format("{}", fmt::join(record.prepared, ", "));
}

void write_file(const std::filesystem::path& file, const std::string& content) {
  const storage::Draft part{std::filesystem::path{file}.concat(".part")};
  std::ofstream out{part.path(), std::ios::binary};
  out << content << std::flush;
  if (!out) throw std::runtime_error{fmt::format("cannot write '{}'; is the disk full?", file.string())};
  out.close();
  storage::finish_file(part.path(), file);
}

}  // namespace

std::string unsigned_reason(const CommissionRecord& record) {
  std::vector<std::string> failed, missing;
  for (const StepFinding& one : record.findings) {
    if (one.verdict == Verdict::fail) failed.push_back(one.step);
    if (one.verdict == Verdict::not_done) missing.push_back(one.step);
  }
  std::string reason;
  const auto add = [&reason](const std::string& more) { reason += (reason.empty() ? "" : "; ") + more; };
  if (!record.ended_by.empty()) add("it ended before its end: " + record.ended_by);
  if (!failed.empty()) add(fmt::format("failed: {}", fmt::join(failed, ", ")));
  if (!missing.empty()) add(fmt::format("not done: {}", fmt::join(missing, ", ")));
  for (const Json& run : record.runs) {
    if (!run.value("sha256", Json()).is_string()) add(fmt::format("run {} has no digest", cell_of(run.at("run_id"))));
  }
  if (is_unwatched(record)) add("nobody watched it: --yes and a prepared `direction` are for simulated robots");
  return reason;
}

const char* outcome_of(const CommissionRecord& record) {
  if (!unsigned_reason(record).empty()) return "not_passed";
  const bool has_attention =
      std::ranges::any_of(record.findings, [](const StepFinding& one) { return one.verdict == Verdict::attention; });
  return has_attention ? "passed_with_attention" : "passed";
}

Json document_of(const CommissionRecord& record) {
  Json document{{"format", "rheonaut commission record"},
                {"format_version", 1},
                {"robot_id", record.robot_id},
                {"outcome", outcome_of(record)},
                {"signed_by", record.signed_by.empty() ? Json(nullptr) : Json(record.signed_by)},
                {"unsigned_because", record.signed_by.empty() ? Json(record.unsigned_because) : Json(nullptr)},
                {"begun_at", moment_of(record.begun_at_us)},
                {"ended_at", moment_of(record.ended_at_us)},
                {"subject", record.subject},
                {"plan", record.plan},
                {"confirmed_by", confirmed_by(record)},
                {"answers", record.answers},
                {"answers_given_beforehand", record.prepared}};
  document["findings"] = Json::array();
  for (const StepFinding& one : record.findings) {
    document["findings"].push_back({{"step", one.step},
                                    {"verdict", text(one.verdict)},
                                    {"found", one.found},
                                    {"judged_by", one.bound},
                                    {"what_to_do", one.action},
                                    {"figures", one.figures}});
  }
  document["runs"] = record.runs;
  return document;
}

std::string page_of(const CommissionRecord& record) {
  std::string page = fmt::format("# Commissioning of {}\n\n", record.robot_id);
  page += fmt::format("Outcome: **{}**. ", outcome_of(record));
  page += record.signed_by.empty() ? fmt::format("**Not signed**: {}.\n\n", record.unsigned_because)
                                   : fmt::format("Signed by {}.\n\n", record.signed_by);
  page += fmt::format("Each step confirmed by {}. Answers given beforehand: {}.\n\n", confirmed_by(record),
                      prepared_text(record));
  page += fmt::format("From {} to {} (UTC).\n\n| subject | |\n|---|---|\n", moment_of(record.begun_at_us),
                      moment_of(record.ended_at_us));
  for (const auto& [name, value] : record.subject.items()) {
    page += fmt::format("| {} | {} |\n", name, in_cell(cell_of(value)));
  }
  page += "\n| step | verdict | found | judged by | what to do |\n|---|---|---|---|---|\n";
  for (const StepFinding& one : record.findings) {
    page += fmt::format("| {} | {} | {} | {} | {} |\n", one.step, text(one.verdict), in_cell(one.found),
                        in_cell(one.bound), in_cell(one.action));
  }
  page += "\nPositions are the robot's own estimate, with two standard deviations where ± stands beside them.\n";
  page += "\n| run | purpose | samples | lost | SHA-256 |\n|---|---|---|---|---|\n";
  for (const Json& run : record.runs) {
    page +=
        fmt::format("| {} | {} | {} | {} | {} |\n", cell_of(run.at("run_id")), in_cell(cell_of(run.at("purpose"))),
                    cell_of(run.at("samples_expected")), cell_of(run.at("samples_lost")), cell_of(run.at("sha256")));
  }
  return page +
         "\n`record.json` has every figure. `sha256sum --check SHA256SUMS` in this folder says whether both are as "
         "they were written.\n";
}

void check_writable(const std::filesystem::path& where) {
  if (std::filesystem::is_directory(where) && ::access(where.c_str(), W_OK | X_OK) == 0) return;
  throw std::runtime_error{
      fmt::format("no record can be written into '{}': it is no folder, or not yours; choose one with "
                  "--into",
                  where.string())};
}

Json printed_of(const CommissionRecord& record, const WrittenRecord& written, const std::string& not_marked) {
  Json answer = document_of(record);
  answer["folder"] = written.folder.string();
  answer["sha256"] = written.sha256;
  answer["not_marked"] = not_marked.empty() ? Json(nullptr) : Json(not_marked);
  return answer;
}

WrittenRecord write(const CommissionRecord& record, const std::filesystem::path& where) {
  const std::filesystem::path folder =
      where / fmt::format("commission-{}-{:%Y%m%dT%H%M%SZ}", record.robot_id, utc_of(record.begun_at_us));
  if (::mkdir(folder.c_str(), 0755) != 0) {  // fails for one that exists
    throw std::runtime_error{fmt::format("cannot make the folder '{}': {}", folder.string(), std::strerror(errno))};
  }
  const std::string json = document_of(record).dump(2, ' ', false, Json::error_handler_t::replace) + "\n",
                    page = page_of(record);
  const std::string sha256 = runtime::sha256_of(json);
  try {
    write_file(folder / "record.json", json);
    write_file(folder / "record.md", page);
    write_file(folder / "SHA256SUMS",
               fmt::format("{}  record.json\n{}  record.md\n", sha256, runtime::sha256_of(page)));
  } catch (...) {  // half a record could be taken for a signed one
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
    throw;
  }
  return {folder, sha256};
}

}  // namespace server::cli
