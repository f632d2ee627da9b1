// A model's JSON, checked member by member.
#include "server/api/bodies/fluid_model_body.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "base/json_text.hpp"
#include "server/analysis/control_json.hpp"
#include "server/api/bodies/limits.hpp"

namespace server::api {
namespace {

using nlohmann::json;

constexpr std::pair<const char*, Range<std::size_t>> kTexts[] = {
    {"name", text_bytes("FluidModelBody.name")},
    {"comment", text_bytes("FluidModelBody.comment")},
    {"description", text_bytes("FluidModelBody.description")},
    {"confirmed_because", text_bytes("FluidModelBody.confirmed_because")}};

// Each is a float32 on its way to the robot: what is checked is what is sent.
Result<station::FluidModel::Numbers> sections_in(const Members& body, const char* name, Range<double> allowed) {
  const auto minimum = static_cast<float>(allowed.minimum), maximum = static_cast<float>(allowed.maximum);
  const auto wrong = [name] {
    return fail(ErrorCode::bad_request,
                fmt::format("{} must be a list of {} numbers", name, station::kFluidModelSections), "wrong_type");
  };
  if (!body.has(name)) return fail(ErrorCode::bad_request, fmt::format("{} is missing", name), "missing_member");
  const json& list = body.object().at(name);
  if (!list.is_array() || list.size() != station::kFluidModelSections) return wrong();
  station::FluidModel::Numbers out{};
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!list[i].is_number()) return wrong();
    out[i] = static_cast<float>(list[i].get<double>()) + 0.0F;  // never -0, which the database would not keep
    if (std::isfinite(out[i]) && out[i] >= minimum && out[i] <= maximum) continue;
    return fail(ErrorCode::invalid,
                fmt::format("{}[{}] = {} is outside {} to {}, the range of the robot's parameter", name, i,
                            list[i].dump(), minimum, maximum),
                "out_of_range");
  }
  return out;
}

Result<double> fit_error_in(const Members& body) {
  const auto fit_error = body.number("fit_error");
  if (!fit_error) return fit_error;
  constexpr Range<double> kAllowed = numbers("FluidModelBody.fit_error");
  if (!(*fit_error >= kAllowed.minimum)) {
    return fail(ErrorCode::invalid, fmt::format("fit_error = {} is negative", *fit_error), "out_of_range");
  }
  if (*fit_error > kAllowed.maximum) {
    return fail(ErrorCode::invalid,
                fmt::format("fit_error = {:.2g} %: a model that is off by more than {} % of the final velocity makes a "
                            "robot surer of its position than it may be; fit it again, or leave the robots without one",
                            *fit_error * 100, kAllowed.maximum * 100),
                "fit_too_bad");
  }
  return fit_error;
}

Result<std::string> document_in(const Members& body, const analysis::ModelDoubts& doubts) {
  json document = json::object();
  for (const auto& [name, bytes] : kTexts) {
    if (!body.has(name)) continue;
    const auto text = body.text(name, bytes);
    if (!text) return text;
    document[name] = *text;
  }
  if (body.has("plant")) {
    const json& plant = body.object().at("plant");
    if (!plant.is_object()) return fail(ErrorCode::bad_request, "plant must be an object", "wrong_type");
    document["plant"] = plant;
  }
  if (doubts.is_of_fit) document["doubts"] = nullptr;
  if (doubts.are_known) document["doubts"] = analysis::json_of(std::span{doubts.doubts});
  std::string text = base::dump(document);
  if (text.size() <= kMaxDocumentBytes) return text;
  return fail(
      ErrorCode::invalid,
      fmt::format("plant and texts have {} bytes together, at most {} are kept", text.size(), kMaxDocumentBytes),
      "out_of_range");
}

json list_of(const station::FluidModel::Numbers& numbers) {
  json list = json::array();
  for (const float number : numbers) list.push_back(base::decimal(number));
  return list;
}

}  // namespace

Result<station::FluidModel> parse_fluid_model(const std::string& text) {
  const auto body = Members::parse(text, {"model_gain_m_s", "model_time_constant_s", "fit_error", "plant", "name",
                                          "comment", "description", "doubts", "widening", "confirmed_because"});
  if (!body) return std::unexpected{body.error()};
  station::FluidModel model;
  const auto gain = sections_in(*body, "model_gain_m_s", numbers("FluidModelBody.model_gain_m_s[]"));
  if (!gain) return std::unexpected{gain.error()};
  const auto time_constant =
      sections_in(*body, "model_time_constant_s", numbers("FluidModelBody.model_time_constant_s[]"));
  if (!time_constant) return std::unexpected{time_constant.error()};
  const auto fit_error = fit_error_in(*body);
  if (!fit_error) return std::unexpected{fit_error.error()};
  const auto doubts = analysis::doubts_from(body->object());
  if (!doubts) return std::unexpected{doubts.error()};
  auto document = document_in(*body, *doubts);
  if (!document) return std::unexpected{document.error()};
  // SAFETY: a model that is in grave doubt is confirmed for robots only by somebody who says why.
  const bool has_reason = body->has("confirmed_because");
  if (!has_reason) model.assumed_because = analysis::grave_doubts_in_words(*doubts);
  model.gain_m_s = *gain;
  model.time_constant_s = *time_constant;
  model.fit_error = *fit_error;
  model.document = std::move(*document);
  return model;
}

Result<OwnModelBody> parse_own_model(const std::string& text) {
  const auto body = Members::parse(text, {"fluid", "model"});
  if (!body) return std::unexpected{body.error()};
  const auto fluid = body->text("fluid", text_bytes("OwnModelBody.fluid"));
  if (!fluid) return std::unexpected{fluid.error()};
  if (!body->has("model")) return fail(ErrorCode::bad_request, "model is missing", "missing_member");
  auto model = parse_fluid_model(base::dump(body->object().at("model")));
  if (!model) return std::unexpected{model.error()};
  return OwnModelBody{*fluid, std::move(*model)};
}

json to_json(const station::FluidModel& model) {
  json out = json::parse(model.document, nullptr, false);
  if (!out.is_object()) out = json::object();
  out["model_gain_m_s"] = list_of(model.gain_m_s);
  out["model_time_constant_s"] = list_of(model.time_constant_s);
  out["fit_error"] = model.fit_error;
  out["assumed_because"] = model.assumed_because.empty() ? json(nullptr) : json(model.assumed_because);
  out["set_by"] = model.set_by;
  out["set_at_us"] = model.set_at_us;
  return out;
}

}  // namespace server::api
