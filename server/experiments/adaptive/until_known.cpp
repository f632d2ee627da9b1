#include "server/experiments/adaptive/until_known.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace server::experiments {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

// Before that many runs a model is too uncertain to say what cannot be reached.
constexpr std::size_t kFewestRunsToGiveUp = 2;

json or_null(const std::optional<double>& value) { return value ? json(*value) : json(nullptr); }

// The same, with what it throws as an error.
template <class Work>
auto guarded(Work work) {
  return [work = std::move(work)]() -> Result<std::invoke_result_t<const Work&>> {
    try {
      return work();
    } catch (const std::invalid_argument& error) {
      return fail(ErrorCode::invalid, error.what(), "no_excitation");
    }
  };
}

std::string in_words(const Variant& variant) {
  return fmt::format("step {} at duty × {}", variant.step, variant.duty_factor);
}

// The best of what is not allowed, if it promises more than what is.
const Promise* better_but_forbidden(const NextExcitation& found) {
  const Promise* best = nullptr;
  for (const Promise& promise : found.promises) {
    if (promise.forbidden.empty() || !promise.sigma) continue;
    if (found.promised_sigma && *promise.sigma >= *found.promised_sigma) continue;
    if (best == nullptr || *promise.sigma < *best->sigma) best = &promise;
  }
  return best;
}

std::string forbidden_in_words(const NextExcitation& found) {
  const Promise* best = better_but_forbidden(found);
  if (best == nullptr) return "";
  return fmt::format("; {} would tell more, but is not allowed: {}", in_words(best->variant), best->forbidden);
}

}  // namespace

asio::awaitable<Result<std::optional<Variant>>> UntilKnown::next(std::vector<storage::RunId> runs,
                                                                 std::function<std::string()> actor,
                                                                 control::FractionalModel in_use,
                                                                 std::function<bool()> is_wanted) {
  Known known;
  known.model = in_use;
  std::optional<FittedModel> fitted;
  const Until& until = profile_.until.value();
  if (!runs.empty()) {
    const bool is_order = control::kParameterNames[until.parameter] == std::string_view{"alpha"} ||
                          control::kParameterNames[until.parameter] == std::string_view{"beta"};
    FitRequest request{std::move(runs), is_order, std::move(actor), is_wanted};
    auto fit = co_await fit_(std::move(request));
    if (!fit) co_return fail(fit.error().code, fit.error().detail, "fit_failed");
    fitted = std::move(*fit);
    known = {fitted->model, fitted->one_sigma[until.parameter], fitted->residual_sd, fitted->is_of_acceleration};
    knowledge_ = knowledge_of(*fitted, std::nullopt);
    const bool is_known = known.sigma && *known.sigma <= until.sigma;
    if (is_known) {
      conclusion_ = Conclusion{"target_reached", state_in_words(fitted)};
      co_return std::nullopt;
    }
    if (chosen_.size() >= profile_.most_runs) {
      conclusion_ = Conclusion{"most_runs", state_in_words(fitted) + ", and the profile allows no more runs"};
      co_return std::nullopt;
    }
  }
  std::vector<Candidate> candidates;
  for (const Variant& variant : variants_of(profile_)) {  // one after the other, since others wait for the worker
    if (!is_wanted()) co_return fail(ErrorCode::conflict, "it is not wanted any more", "not_wanted");
    auto compute = guarded([profile = profile_, variant, known] { return candidate_of(profile, variant, known); });
    auto candidate = co_await maths_.run(std::move(compute));
    if (!candidate) co_return std::unexpected{candidate.error()};
    candidates.push_back(std::move(*candidate));
  }
  auto choose = guarded([profile = profile_, done = chosen_, known, candidates = std::move(candidates)] {
    return next_excitation(profile, done, known, candidates);
  });
  const Result<NextExcitation> found = co_await maths_.run(std::move(choose));
  if (!found) co_return std::unexpected{found.error()};
  if (fitted) knowledge_ = knowledge_of(*fitted, *found);
  conclusion_ = conclusion_of(fitted, *found);
  if (conclusion_) co_return std::nullopt;
  chosen_.push_back(*found->next);
  co_return found->next;
}

std::optional<Conclusion> UntilKnown::conclusion_of(const std::optional<FittedModel>& fitted,
                                                    const NextExcitation& found) const {
  const Until& until = profile_.until.value();
  const std::optional<double> sigma = fitted ? fitted->one_sigma[until.parameter] : std::nullopt;
  if (!found.next) {
    return Conclusion{"target_out_of_reach",
                      fmt::format("{}: no choice of the profile is allowed; {}: {}", state_in_words(fitted),
                                  in_words(found.promises.front().variant), found.promises.front().forbidden)};
  }
  const bool can_tell = sigma && chosen_.size() >= kFewestRunsToGiveUp;
  if (!can_tell || !found.reachable_sigma || *found.reachable_sigma <= until.sigma) return std::nullopt;
  return Conclusion{"target_out_of_reach",
                    fmt::format("{}; even {} more of every choice that is allowed would bring it to {:.2g} only{}",
                                state_in_words(fitted), profile_.most_runs - chosen_.size(), *found.reachable_sigma,
                                forbidden_in_words(found))};
}

std::string UntilKnown::state_in_words(const std::optional<FittedModel>& fitted) const {
  const Until& until = profile_.until.value();
  const char* parameter = control::kParameterNames[until.parameter];
  const std::string runs = chosen_.size() == 1 ? "1 run" : fmt::format("{} runs", chosen_.size());
  const std::optional<double> sigma = fitted ? fitted->one_sigma[until.parameter] : std::nullopt;
  if (sigma) {
    const bool means_little = is_at_bound(*fitted, until.parameter);
    return fmt::format("sigma({}) is {:.2g} after {}, wanted is {:g}{}", parameter, *sigma, runs, until.sigma,
                       means_little ? fmt::format("; it means little, since {} lies at its bound", parameter) : "");
  }
  const bool has_converged = !fitted || fitted->end == "converged";
  return fmt::format("{} is not determined after {}{}", parameter, runs,
                     has_converged ? "" : fmt::format(" (the search ended by {})", fitted->end));
}

json UntilKnown::knowledge_of(const FittedModel& fitted, const std::optional<NextExcitation>& found) const {
  const Until& until = profile_.until.value();
  json out = {{"parameter", control::kParameterNames[until.parameter]},
              {"target_sigma", until.sigma},
              {"sigma", or_null(fitted.one_sigma[until.parameter])},
              {"at_bound", is_at_bound(fitted, until.parameter)},
              {"fit", to_json(fitted)},
              {"promised_sigma", nullptr},
              {"reachable_sigma", nullptr},
              {"choices", json::array()}};
  if (!found) return out;
  out["promised_sigma"] = or_null(found->promised_sigma);
  out["reachable_sigma"] = or_null(found->reachable_sigma);
  for (const Promise& promise : found->promises) {
    out["choices"].push_back({{"step", promise.variant.step},
                              {"duty_factor", promise.variant.duty_factor},
                              {"promised_sigma", or_null(promise.sigma)},
                              {"forbidden", promise.forbidden.empty() ? json(nullptr) : json(promise.forbidden)}});
  }
  return out;
}

}  // namespace server::experiments
