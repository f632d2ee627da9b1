// Writes the doubts about a model, and reads them where it is used.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "server/analysis/control_json.hpp"
#include "server/analysis/optional_json.hpp"

namespace server::analysis {
using control::Doubt;
using control::DoubtCode;
using nlohmann::json;

namespace {

constexpr std::size_t kMostDoubts = 32;
constexpr double kNoticeable = 1.05;  // widening
constexpr const char* kNotKnown = "an earlier version has made this fit: what is in doubt about it is not known";
constexpr std::array kCodes{DoubtCode::search_not_converged,
                            DoubtCode::no_linear_model_over_amplitude,
                            DoubtCode::runs_disagree,
                            DoubtCode::residuals_not_white,
                            DoubtCode::residuals_drift,
                            DoubtCode::parameter_not_determined,
                            DoubtCode::parameter_at_bound,
                            DoubtCode::part_of_run_used,
                            DoubtCode::dead_time_not_determined,
                            DoubtCode::correlated_with_input,
                            DoubtCode::sensor_unlike_data_sheet,
                            DoubtCode::dead_zone};

std::optional<double> number_or_none(const json& value) {
  return value.is_null() ? std::nullopt : std::optional{value.get<double>()};
}

Doubt doubt_from(const json& entry) {
  const std::string code = entry.at("code");
  const auto known = std::ranges::find_if(kCodes, [&code](DoubtCode one) { return code == text(one); });
  if (known == kCodes.end()) throw std::invalid_argument{code};
  return {*known, number_or_none(entry.at("value")), entry.value("parameter", std::string{}),
          number_or_none(entry.at("widening"))};
}

std::vector<std::string> words_of(const ModelDoubts& known, bool (*is_meant)(const Doubt&)) {
  std::vector<std::string> words;
  for (const Doubt& doubt : known.doubts) {
    if (is_meant(doubt)) words.push_back(control::in_words(doubt));
  }
  return words;
}

}  // namespace

const char* text(DoubtCode value) {
  switch (value) {
    case DoubtCode::search_not_converged: return "search_not_converged";
    case DoubtCode::no_linear_model_over_amplitude: return "no_linear_model_over_amplitude";
    case DoubtCode::runs_disagree: return "runs_disagree";
    case DoubtCode::residuals_not_white: return "residuals_not_white";
    case DoubtCode::residuals_drift: return "residuals_drift";
    case DoubtCode::parameter_not_determined: return "parameter_not_determined";
    case DoubtCode::parameter_at_bound: return "parameter_at_bound";
    case DoubtCode::part_of_run_used: return "part_of_run_used";
    case DoubtCode::dead_time_not_determined: return "dead_time_not_determined";
    case DoubtCode::correlated_with_input: return "correlated_with_input";
    case DoubtCode::sensor_unlike_data_sheet: return "sensor_unlike_data_sheet";
    case DoubtCode::dead_zone: return "dead_zone";
  }
  return "unknown";
}

OrderedJson json_of(std::span<const Doubt> doubts) {
  OrderedJson out = OrderedJson::array();
  for (const Doubt& doubt : doubts) {
    OrderedJson& entry = out.emplace_back(OrderedJson{{"code", text(doubt.code)}, {"value", or_null(doubt.value)}});
    if (!doubt.parameter.empty()) entry["parameter"] = doubt.parameter;
    entry["widening"] = or_null(doubt.widening);
    entry["grave"] = control::is_grave(doubt);
    entry["text"] = control::in_words(doubt);
  }
  return out;
}

Result<ModelDoubts> doubts_from(const json& fit) {
  ModelDoubts known;
  const bool are_unknown = fit.is_object() && fit.contains("doubts") && fit.at("doubts").is_null();
  known.is_of_fit = fit.is_object() && (fit.contains("one_sigma") || are_unknown);
  if (!fit.is_object() || !fit.contains("doubts") || fit.at("doubts").is_null()) return known;
  const json& list = fit.at("doubts");
  const auto wrong = [](const std::string& what) {
    return fail(ErrorCode::bad_request,
                "\"doubts\" is not as identify prints it: " + what +
                    "; give the list as it is, or null for a model of which nobody knows them",
                "wrong_type");
  };
  if (!list.is_array() || list.size() > kMostDoubts) return wrong(fmt::format("a list of at most {}", kMostDoubts));
  known.are_known = true;
  for (const json& entry : list) {
    try {
      known.doubts.push_back(doubt_from(entry));
    } catch (const json::exception&) {
      return wrong("each has \"code\", \"value\" and \"widening\"");
    } catch (const std::invalid_argument& code) {
      return wrong(fmt::format("the code \"{}\" is not known", code.what()));
    }
    const auto& widening = known.doubts.back().widening;
    if (widening && !(*widening >= 1)) return wrong(fmt::format("a widening is {}, it is 1 at least", *widening));
  }
  return known;
}

std::string doubts_in_words(const ModelDoubts& known) {
  if (!known.are_known) return known.is_of_fit ? kNotKnown : "";
  const auto matters = [](const Doubt& doubt) {
    return !doubt.widening || *doubt.widening > kNoticeable || doubt.code == DoubtCode::dead_time_not_determined ||
           doubt.code == DoubtCode::dead_zone;
  };
  std::vector<std::string> words = words_of(known, matters);
  if (words.empty()) return {};
  const auto widening = control::widening(known.doubts);
  if (!widening)
    words.emplace_back("no ± can be given for what is computed from it");
  else if (*widening > kNoticeable)
    words.push_back(fmt::format("each ± of what is computed from it is widened {:.2g} times", *widening));
  return fmt::format("in doubt: {}", fmt::join(words, "; "));
}

std::string doubts_about_model(const json& design) {
  if (!design.is_object()) return {};
  if (const auto said = design.find("plant_doubts_text"); said != design.end()) {
    return said->is_string() ? said->get<std::string>() : std::string{};
  }
  const auto known = doubts_from(design);
  return known ? doubts_in_words(*known) : std::string{};
}

std::string grave_doubts_in_words(const ModelDoubts& known) {
  if (!known.are_known && known.is_of_fit) return kNotKnown;
  return fmt::format("{}", fmt::join(words_of(known, control::is_grave), "; "));
}

}  // namespace server::analysis
