// By AIC, as far as the searches came to their end.
#include "control/identification/structure_choice.hpp"

#include <algorithm>
#include <span>
#include <sstream>
#include <tuple>
#include <utility>

#include "base/invalid_argument.hpp"
#include "control/identification/identifiability.hpp"

namespace control {

void put_best_first(std::vector<Fit>& fits) {
  const auto key = [](const Fit& fit) { return std::pair(fit.aic, fit.free_parameters); };
  std::ranges::sort(fits, {}, [&](const Fit& fit) { return std::tuple(fit.starts == 0, key(fit)); });
  std::ranges::sort(fits.begin() + 1, fits.end(), {}, [&](const Fit& fit) {
    return std::tuple(fit.starts == 0, fit.end != SearchEnd::converged, key(fit));
  });
}

std::vector<std::string> untried_structures(const std::vector<Fit>& fits) {
  std::vector<std::string> warnings;
  for (const Fit& fit : std::span(fits).subspan(1)) {
    if (fit.end == SearchEnd::converged) continue;
    const std::string name = structure_name(fit.structure);
    warnings.push_back(fit.starts == 0 ? base::join_text("the ", name, " model was not tried, since the search ",
                                                         end_words(fit.end),
                                                         ": the one given may not be the best of the structures")
                                       : base::join_text("the search for the ", name, " model ", end_words(fit.end),
                                                         " after ", fit.starts, fit.starts == 1 ? " start" : " starts",
                                                         ": it may be better than it looks, and is not compared"));
  }
  return warnings;
}

void add_verdict(const std::vector<Fit>& fits, std::size_t runs, std::vector<std::string>& warnings) {
  const Fit& best = fits.front();
  for (const Fit& fit : std::span(fits).subspan(1)) {
    if (fit.structure != Structure::fractional || fit.end != SearchEnd::converged) continue;
    std::ostringstream text;
    text.precision(3);
    text << (runs == 1 ? "this run does not" : "these runs do not") << " call for fractional orders: the AIC of the "
         << structure_name(best.structure) << " model is lower by " << fit.aic - best.aic
         << "; a duty that changes faster, less noise or a longer run would tell them apart if they are there";
    warnings.push_back(text.str());
  }
}

void add_rival(const std::vector<Fit>& fits, std::vector<std::string>& warnings) {
  constexpr double kNoSupport = 10;
  const Fit& best = fits.front();
  if (best.structure != Structure::fractional || fits.size() < 2) return;
  const Fit& rival = fits[1];  // the best of the others, if its search is finished
  if (rival.end != SearchEnd::converged || !(rival.aic - best.aic < kNoSupport)) return;
  std::ostringstream text;
  text.precision(2);
  text << "this run cannot determine whether the orders are fractional, so alpha and beta are open: the AIC of the "
       << structure_name(rival.structure) << " model is higher by " << rival.aic - best.aic
       << " only (10 would rule it out), whatever their sigmas say; let the duty change faster, during a longer run";
  warnings.push_back(text.str());
}

}  // namespace control
