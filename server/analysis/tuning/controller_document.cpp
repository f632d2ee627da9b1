// Coefficients that are there are checked against kp; those that are not are computed.
#include "server/analysis/tuning/controller_document.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "server/runtime/exceptions.hpp"

namespace server::analysis {
namespace {

constexpr double kSameGain = 1e-6;  // relative: the DC gain of what discretise makes is kp

// Of what discretise prints only what the robot needs; the rest explains it to people.
nlohmann::json what_is_sent(const nlohmann::json& discretised) {
  nlohmann::json sent;
  for (const char* name : {"period_s", "dc_gain", "sections", "duty_min", "duty_max"}) {
    if (discretised.contains(name)) sent[name] = discretised.at(name);
  }
  return sent;
}

Result<nlohmann::json> kept_sections(const nlohmann::json& discretised, double kp) {
  for (const char* name : {"period_s", "dc_gain", "sections"}) {
    if (discretised.is_object() && discretised.contains(name)) continue;
    return fail(ErrorCode::invalid, fmt::format("its \"discretised\" has no {}; tune again", name), "no_controller");
  }
  const nlohmann::json& gain = discretised.at("dc_gain");
  if (gain.is_number() && std::abs(gain.get<double>() / kp - 1) <= kSameGain) return what_is_sent(discretised);
  return fail(ErrorCode::invalid,
              fmt::format("its \"discretised\" has the DC gain {}, but kp is {}: it is another controller's",
                          gain.is_number() ? gain.dump() : "null", kp),
              "no_controller");
}

}  // namespace

OrderedJson discretised_json(const control::DiscretisationChoice& choice) {
  OrderedJson out = json_of(choice.chosen);
  out["reason"] = choice.reason;
  return out;
}

Result<nlohmann::json> sections_of(const nlohmann::json& document, double period_s, bool is_one_way) {
  const auto controller = controller_from(document);
  if (!controller) return std::unexpected{Error{ErrorCode::invalid, controller.error().detail, "no_controller"}};
  const auto kept = document.find("discretised");
  if (kept != document.end() && !kept->is_null()) return kept_sections(*kept, controller->kp);
  try {
    const auto made = discretised(*controller, sampling_for(period_s, is_one_way));
    return what_is_sent(nlohmann::json(discretised_json(made)));
  } catch (const std::exception& error) {
    return fail(ErrorCode::invalid, fmt::format("it cannot be discretised: {}", runtime::text_of(error)),
                "no_controller");
  }
}

}  // namespace server::analysis
