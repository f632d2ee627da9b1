// What autotune has done so far, as a file that the next call goes on from.
//
//   {"version": 1, "client": "…", "request": {…}, "stages": {"identification": {"done": true, "experiment_id": 1,
//   "run_id": 3}, …}}
//
// `client` is the id by which the station knows it: an experiment that the call before began is still its own.
// `request` names the robot and the experiments; a file of another request is refused. The file is written whole or not
// at all, after each stage and when something that the station does has begun.
// Errors: throws std::runtime_error that names the file.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace server::cli {

class AutotuneState {
 public:
  // With a file that exists, from what it says; with one that does not, or none, from the beginning.
  AutotuneState(std::optional<std::filesystem::path> file, const nlohmann::json& request);

  bool is_done(const std::string& stage) const;
  const nlohmann::json& of(const std::string& stage) const { return document_.at("stages").at(stage); }
  // A number that the stage has noted; none: it has not come so far.
  std::optional<std::int64_t> number(const std::string& stage, const char* name) const;

  void note(const std::string& stage, const char* name, const nlohmann::json& value);  // and writes the file
  void finish(const std::string& stage, nlohmann::json what);                          // the same
  void forget(const std::string& stage);                                               // the same

  const nlohmann::json& document() const { return document_; }

 private:
  void write() const;

  std::optional<std::filesystem::path> file_;
  nlohmann::json document_;
};

}  // namespace server::cli
