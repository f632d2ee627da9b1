// The record of a commissioning: one folder with the record as JSON, the same as a page, and the SHA-256 of both.
//
//   commission-ROBOT-YYYYMMDDTHHMMSSZ/record.json   everything, for programs
//                                     record.md     the same for people
//                                     SHA256SUMS    of both, for `sha256sum --check`; written last: without it the
//                                     record
//                                                   is not whole
// The folder is made for this record: nothing that exists is written over. Errors: throws std::runtime_error or
// std::system_error that names the folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/cli/commission/finding.hpp"

namespace server::cli {

struct CommissionRecord {
  std::string robot_id;
  std::int64_t begun_at_us = 0, ended_at_us = 0;                      // UTC
  nlohmann::ordered_json subject = nlohmann::ordered_json::object();  // versions, boot, controller, parameters, fluid
  nlohmann::ordered_json plan = nlohmann::ordered_json::object();
  nlohmann::ordered_json answers = nlohmann::ordered_json::object();
  bool is_confirmed_beforehand = false;  // by --yes: nobody said that the way was free
  std::vector<std::string> prepared;     // names of the answers that were given beforehand
  std::vector<StepFinding> findings;
  std::vector<nlohmann::ordered_json> runs;
  std::string signed_by;         // empty: nobody
  std::string unsigned_because;  // why nobody could sign it; empty: it may be signed
  std::string ended_by;          // what ended it before its end; empty: it came to its end
};

// Why the record must stay unsigned: what failed or was not done, a run without a digest, or a real robot that nobody
// watched; empty: nothing.
std::string unsigned_reason(const CommissionRecord& record);

const char* outcome_of(const CommissionRecord& record);  // "passed", "passed_with_attention", "not_passed"

nlohmann::ordered_json document_of(const CommissionRecord& record);
std::string page_of(const CommissionRecord& record);  // Markdown

struct WrittenRecord {
  std::filesystem::path folder;
  std::string sha256;  // of record.json
};
// The record as `--json` prints it. `not_marked`: why the station has no marker of it; empty: it has, or needs none.
nlohmann::ordered_json printed_of(const CommissionRecord& record, const WrittenRecord& written,
                                  const std::string& not_marked);

WrittenRecord write(const CommissionRecord& record, const std::filesystem::path& where);

// Throws std::runtime_error when no folder can be made there.
void check_writable(const std::filesystem::path& where);

}  // namespace server::cli
