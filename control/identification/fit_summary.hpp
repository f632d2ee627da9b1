// Turns the result of a search into a fit: its residuals, the sigmas of the parameters, the AIC.
//
// Sigmas are those of the cost: (5) of identify.hpp for least squares, (6) for the absolute error. A structure that was
// never searched has none.
#pragma once

#include "control/search/fit.hpp"
#include "control/search/output_error_search.hpp"

namespace control {

Fit summary(OutputErrorSearch& search, const Recording& recording, Cost cost, Structure structure,
            const SearchResult& found);

}  // namespace control
