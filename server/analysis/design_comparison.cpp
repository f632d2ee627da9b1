// Parameters by name, in a table.
#include "server/analysis/design_comparison.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <vector>

namespace server::analysis {
namespace {

struct Parameter {
  const char* name;
  double value = 0;
  std::optional<double> one_sigma;
};

Result<std::vector<Parameter>> parameters_of(const storage::Design& design) {
  const nlohmann::json document = nlohmann::json::parse(design.made.document, nullptr, false);
  if (design.made.kind == storage::DesignKind::controller) {
    const auto controller = controller_from(document);
    if (!controller) return std::unexpected{controller.error()};
    return std::vector<Parameter>{{"kp", controller->kp, {}}, {"kd", controller->kd, {}}, {"mu", controller->mu, {}}};
  }
  const auto read = model_from(document);
  if (!read) return std::unexpected{read.error()};
  const auto uncertainty = uncertainty_from(document);
  if (!uncertainty) return std::unexpected{uncertainty.error()};
  const control::FractionalModel model = control::normalised(*read);
  const std::array values{model.kp, model.b1, model.b2, model.alpha, model.beta};
  std::vector<Parameter> parameters;
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    parameters.push_back({control::kParameterNames[i], values[i], {}});
    if (*uncertainty) parameters.back().one_sigma = (*uncertainty)->one_sigma[i];
  }
  parameters.push_back({"dead_time_s", model.dead_time_s, {}});
  return parameters;
}

OrderedJson or_null(std::optional<double> value) { return value ? OrderedJson(*value) : OrderedJson(nullptr); }

std::optional<double> relative_difference(double value, double first) {
  if (value == first) return 0;
  if (first == 0) return std::nullopt;
  return value / first - 1;
}

std::optional<double> sigmas_between(const Parameter& one, const Parameter& first) {
  if (!one.one_sigma || !first.one_sigma) return std::nullopt;
  const double sigma = std::hypot(*one.one_sigma, *first.one_sigma);
  if (!(sigma > 0)) return std::nullopt;
  return (one.value - first.value) / sigma;
}

OrderedJson row_of(const std::vector<std::vector<Parameter>>& all, std::size_t index) {
  const Parameter& first = all.front()[index];
  OrderedJson row{{"name", first.name}};
  for (const std::vector<Parameter>& one : all) {
    const Parameter& parameter = one[index];
    row["values"].push_back(parameter.value);
    row["one_sigma"].push_back(or_null(parameter.one_sigma));
    row["relative_to_first"].push_back(or_null(relative_difference(parameter.value, first.value)));
    row["sigmas_from_first"].push_back(or_null(sigmas_between(parameter, first)));
  }
  return row;
}

}  // namespace

Result<void> check_document(storage::DesignKind kind, const nlohmann::json& document) {
  if (kind == storage::DesignKind::controller) {
    const auto controller = controller_from(document);
    if (!controller) return std::unexpected{controller.error()};
    return {};
  }
  if (const auto model = model_from(document); !model) return std::unexpected{model.error()};
  if (const auto uncertainty = uncertainty_from(document); !uncertainty) return std::unexpected{uncertainty.error()};
  return {};
}

Result<OrderedJson> comparison_json(std::span<const storage::Design> designs) {
  OrderedJson out{{"kind", text(designs.front().made.kind)}, {"designs", OrderedJson::array()}};
  std::vector<std::vector<Parameter>> all;
  for (const storage::Design& design : designs) {
    if (design.made.kind != designs.front().made.kind) {
      return fail(ErrorCode::invalid,
                  fmt::format("design {} is a {}, design {} a {}; compare designs of one kind", designs.front().id,
                              text(designs.front().made.kind), design.id, text(design.made.kind)),
                  "other_kind");
    }
    auto parameters = parameters_of(design);
    if (!parameters) return std::unexpected{parameters.error()};
    all.push_back(std::move(*parameters));
    out["designs"].push_back({{"design_id", design.id}, {"name", design.made.name}});
  }
  out["parameters"] = OrderedJson::array();
  for (std::size_t i = 0; i < all.front().size(); ++i) out["parameters"].push_back(row_of(all, i));
  return out;
}

}  // namespace server::analysis
