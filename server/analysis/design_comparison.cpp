// Parameters by name, in a table.
#include "server/analysis/design_comparison.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "control/identification/identifiability.hpp"
#include "server/analysis/optional_json.hpp"

namespace server::analysis {
namespace {

struct Parameter {
  const char* name;
  double value = 0;
  std::optional<double> one_sigma;
  bool is_at_bound = false;  // where its sigma means little
};

struct Compared {
  std::vector<Parameter> parameters;
  std::optional<control::ExpectedUncertainty> uncertainty;  // of a model
};

Result<Compared> parameters_of(const storage::Design& design) {
  const nlohmann::json document = nlohmann::json::parse(design.made.document, nullptr, false);
  if (design.made.kind == storage::DesignKind::controller) {
    const auto controller = controller_from(document);
    if (!controller) return std::unexpected{controller.error()};
    return Compared{{{"kp", controller->kp, {}}, {"kd", controller->kd, {}}, {"mu", controller->mu, {}}}, {}};
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
    if (!*uncertainty) continue;
    parameters.back().one_sigma = (*uncertainty)->one_sigma[i];
    parameters.back().is_at_bound = parameters.back().one_sigma && control::lies_at_bound(i, values[i]);
  }
  parameters.push_back({"dead_time_s", model.dead_time_s, {}});
  return Compared{std::move(parameters), *uncertainty};
}

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

double value_of(const Compared& design, const std::string& name) {
  return std::ranges::find(design.parameters, name, &Parameter::name)->value;
}

// b1 is in s^alpha, b2 in s^beta, kd in s^mu: with another order it is another quantity.
bool has_same_unit(const Compared& one, const Compared& first, const std::string& name) {
  static const std::map<std::string, const char*> kOrders{{"b1", "alpha"}, {"b2", "beta"}, {"kd", "mu"}};
  const auto order = kOrders.find(name);
  return order == kOrders.end() || value_of(one, order->second) == value_of(first, order->second);
}

OrderedJson row_of(const std::vector<Compared>& all, std::size_t index) {
  const Parameter& first = all.front().parameters[index];
  OrderedJson row{{"name", first.name}};
  for (const Compared& one : all) {
    const Parameter& parameter = one.parameters[index];
    const bool compares = has_same_unit(one, all.front(), first.name);
    row["values"].push_back(parameter.value);
    row["one_sigma"].push_back(or_null(parameter.one_sigma));
    row["at_bound"].push_back(parameter.is_at_bound);
    row["relative_to_first"].push_back(
        or_null(compares ? relative_difference(parameter.value, first.value) : std::nullopt));
    row["sigmas_from_first"].push_back(or_null(sigmas_between(parameter, first)));
  }
  return row;
}

// Of the parameters that both fits have free: chi-square = d'(S1 + S2)^-1 d, of the differences d and both covariances,
// and the probability of a larger one where both are of the same model.
OrderedJson together(const Compared& one, const Compared& first) {
  if (!one.uncertainty || !first.uncertainty) return nullptr;
  std::vector<std::size_t> free;
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    if (one.uncertainty->one_sigma[i] && first.uncertainty->one_sigma[i]) free.push_back(i);
  }
  const auto size = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd correlation(size, size);  // in units of the sigma of each difference
  Eigen::VectorXd difference(size);
  const auto sigma = [&](std::size_t i) {
    return std::hypot(*one.uncertainty->one_sigma[i], *first.uncertainty->one_sigma[i]);
  };
  for (Eigen::Index row = 0; row < size; ++row) {
    const std::size_t i = free[static_cast<std::size_t>(row)];
    difference[row] = (one.parameters[i].value - first.parameters[i].value) / sigma(i);
    for (Eigen::Index column = 0; column < size; ++column) {
      const std::size_t j = free[static_cast<std::size_t>(column)];
      double covariance = 0;
      for (const auto* of : {&*one.uncertainty, &*first.uncertainty}) {
        covariance += (i == j ? 1 : of->correlation[i][j]) * *of->one_sigma[i] * *of->one_sigma[j];
      }
      correlation(row, column) = covariance / (sigma(i) * sigma(j));
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> solved{correlation};
  if (size == 0 || !correlation.allFinite() || solved.info() != Eigen::Success) return nullptr;
  const double chi_square = difference.dot(solved.solve(difference));
  return {{"chi_square", chi_square},
          {"degrees_of_freedom", size},
          {"p", boost::math::gamma_q(static_cast<double>(size) / 2, chi_square / 2)}};
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
  std::vector<Compared> all;
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
  for (std::size_t i = 0; i < all.front().parameters.size(); ++i) out["parameters"].push_back(row_of(all, i));
  out["together"] = OrderedJson::array({nullptr});
  for (const Compared& one : std::span{all}.subspan(1)) out["together"].push_back(together(one, all.front()));
  return out;
}

}  // namespace server::analysis
