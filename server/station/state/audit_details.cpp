#include "server/station/state/audit_details.hpp"

#include <nlohmann/json.hpp>

#include "server/station/state/audit_note.hpp"

namespace server::station {

std::string refusal_detail(const std::string& request, const std::string& problem, const std::string& reason) {
  constexpr std::size_t kMaxProblemBytes = 300;
  nlohmann::json detail = nlohmann::json::parse(request, nullptr, false);
  if (!detail.is_object()) detail = nlohmann::json::object();
  detail["problem"] = problem.substr(0, kMaxProblemBytes);
  if (!reason.empty()) detail["reason"] = reason;
  return audit_detail(detail);
}

std::string control_detail(const std::string& cause, const std::string& holder) {
  return audit_detail({{"cause", cause}, {"holder", holder}});
}

std::string fluid_detail(const std::string& before) { return audit_detail({{"before", before}}); }

std::string model_detail(const FluidModel& model) {
  nlohmann::json detail{{"fit_error", model.fit_error}};
  if (!model.assumed_because.empty()) detail["assumed_because"] = model.assumed_because;
  const auto document = nlohmann::json::parse(model.document, nullptr, false);
  if (document.is_object() && document.contains("confirmed_because")) {
    detail["confirmed_because"] = document.at("confirmed_because");
  }
  return audit_detail(detail);
}

std::string refused_command(const std::string& kind, const std::string& arguments) {
  return nlohmann::json{{"kind", kind}, {"arguments", nlohmann::json::parse(arguments, nullptr, false)}}.dump();
}

std::string refused_stop() { return nlohmann::json{{"kind", "emergency_stop"}}.dump(); }

std::string refused_control(const std::string& action) { return nlohmann::json{{"wish", action}}.dump(); }

std::string refused_fluid(const std::string& fluid) { return nlohmann::json{{"fluid", fluid}}.dump(); }

std::string refused_model(const std::string& fluid) { return nlohmann::json{{"model_of", fluid}}.dump(); }

}  // namespace server::station
