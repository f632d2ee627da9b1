// Takes six numbers and a dead time from JSON.
#include "sim_robot/scenario/model_file.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/invalid_argument.hpp"
#include "base/whole_file.hpp"

namespace sim_robot {
namespace {

using Json = nlohmann::json;

constexpr std::array<std::string_view, 7> kNumbers{"kp", "b1", "b2", "b3", "alpha", "beta", "dead_time_s"};
// What the tools add to a model, and what people do.
constexpr std::array<std::string_view, 5> kPassedOver{"name", "comment", "description", "dc_gain_m_s", "poles_rad_s"};

const Json& model_in(const Json& given) {
  if (!given.is_object()) base::throw_invalid("model: ", given.dump(), " is not an object with kp, b1, b2, …");
  for (const char* key : {"parameters", "model"}) {
    if (given.contains(key) && given[key].is_object()) return given[key];
  }
  return given;
}

double number(const Json& model, const char* key) {
  const auto found = model.find(key);
  if (found == model.end()) base::throw_invalid("model: '", key, "' is missing");
  if (!found->is_number()) base::throw_invalid("model: '", key, "' must be a number, is ", found->dump());
  return *found;
}

void refuse_unknown(const Json& model) {
  for (const auto& [key, value] : model.items()) {
    if (std::ranges::find(kNumbers, key) != kNumbers.end()) continue;
    if (std::ranges::find(kPassedOver, key) != kPassedOver.end()) continue;
    base::throw_invalid("model: there is no '", key, "'; it has kp, b1, b2, b3, alpha, beta, dead_time_s");
  }
}

// In the model, or beside it, where an identification says it again.
double dead_time_s(const Json& given, const Json& model) {
  if (!model.contains("dead_time_s")) return given.contains("dead_time_s") ? number(given, "dead_time_s") : 0;
  const double in_model_s = number(model, "dead_time_s");
  const double beside_s = given.contains("dead_time_s") ? number(given, "dead_time_s") : in_model_s;
  if (beside_s != in_model_s) {
    base::throw_invalid("model: 'dead_time_s' is ", in_model_s, " in it and ", beside_s, " beside it; leave one");
  }
  return in_model_s;
}

}  // namespace

PlantParameters parse_model(const std::string& json) {
  const Json given = Json::parse(json, nullptr, false);
  if (given.is_discarded()) base::throw_invalid("model: this is not JSON");
  const Json& model = model_in(given);
  refuse_unknown(model);
  PlantParameters read;
  read.model = {number(model, "kp"),    number(model, "b1"),
                number(model, "b2"),    model.contains("b3") ? number(model, "b3") : 1,
                number(model, "alpha"), number(model, "beta")};
  read.dead_time_s = dead_time_s(given, model);
  check(read);
  return read;
}

PlantParameters load_model(const std::string& path) {
  constexpr std::size_t kMaxBytes = 1 << 20;
  const base::WholeFile whole = base::read_whole(std::filesystem::path{path}, kMaxBytes);
  if (!whole.problem.empty()) base::throw_invalid(path, ": ", whole.problem);
  try {
    return parse_model(whole.text);
  } catch (const std::invalid_argument& error) {
    base::throw_invalid(path, ": ", error.what());
  }
}

}  // namespace sim_robot
