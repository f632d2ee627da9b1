// Read once, written as a whole.
#include "server/cli/experiments/autotune_state.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/runtime/private_file.hpp"

namespace server::cli {

using nlohmann::json;

namespace {

constexpr int kVersion = 1;

json read_document(const std::filesystem::path& file) {
  json document = read_json(file.string());
  const bool is_ours = document.is_object() && document.value("version", 0) == kVersion &&
                       document.value("stages", json()).is_object() && document.contains("request");
  if (is_ours) return document;
  throw std::runtime_error{fmt::format("'{}' is no file of an autotune of this version", file.string())};
}

void refuse_another(const std::filesystem::path& file, const json& held, const json& asked) {
  for (const auto& [name, value] : asked.items()) {
    const json other = held.value(name, json());
    if (other == value) continue;
    throw std::runtime_error{fmt::format("'{}' goes on from an autotune with {} {}, not {}; give another file",
                                         file.string(), name, other.dump(), value.dump())};
  }
}

}  // namespace

AutotuneState::AutotuneState(std::optional<std::filesystem::path> file, const json& request) : file_{std::move(file)} {
  if (file_ && runtime::is_there(*file_)) {
    document_ = read_document(*file_);
    refuse_another(*file_, document_.at("request"), request);
    const json client = document_.value("client", json());
    if (client.is_string()) go_by(client.get<std::string>());
    document_["client"] = invocation_id();  // of a file that had none
    write();
    return;
  }
  document_ = {{"version", kVersion}, {"client", invocation_id()}, {"request", request}, {"stages", json::object()}};
  write();
}

bool AutotuneState::is_done(const std::string& stage) const {
  const json& stages = document_.at("stages");
  return stages.contains(stage) && stages.at(stage).value("done", false);
}

std::optional<std::int64_t> AutotuneState::number(const std::string& stage, const char* name) const {
  const json& stages = document_.at("stages");
  if (!stages.contains(stage)) return std::nullopt;
  const json value = stages.at(stage).value(name, json());
  return value.is_number_integer() ? std::optional{value.get<std::int64_t>()} : std::nullopt;
}

void AutotuneState::note(const std::string& stage, const char* name, const json& value) {
  document_["stages"][stage][name] = value;
  write();
}

void AutotuneState::finish(const std::string& stage, json what) {
  what["done"] = true;
  document_["stages"][stage].update(what);
  write();
}

void AutotuneState::forget(const std::string& stage) {
  document_["stages"].erase(stage);
  write();
}

void AutotuneState::write() const {
  if (file_) runtime::write_private(*file_, document_.dump(2) + "\n");
}

}  // namespace server::cli
