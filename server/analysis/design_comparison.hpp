// Models or controllers side by side: each parameter, and how far it is from that of the first.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "server/analysis/control_json.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/designs/design.hpp"

namespace server::analysis {

// A document that the tools would read as this kind; the error of model_from, uncertainty_from or controller_from.
Result<void> check_document(storage::DesignKind kind, const nlohmann::json& document);

// Of designs of one kind. A model's parameters are divided by b3, so that they compare; its uncertainties are as
// identify found them, null where they are not known. `sigmas_from_first`: of the difference, where both are known.
// `together`: whether all parameters are those of the first, with their correlations; null where not known.
Result<OrderedJson> comparison_json(std::span<const storage::Design> designs);

}  // namespace server::analysis
