// Models, controllers and the results of control/ as JSON: one spelling for files, command line and API.
//
// Keys are the names of the fields in control/, with their units. A number that is not finite or not there is null.
// Reading is strict: a model has kp, b1, b2, alpha, beta and perhaps b3 and dead_time_s, a controller kp, kd, mu;
// beside them only name, comment and description may stand. What our own commands print can be read back: a model from
// `parameters`, a controller from what has `feasible`.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/discretisation/discretise.hpp"
#include "control/discretisation/estimator_model.hpp"
#include "control/identification/identify.hpp"
#include "control/identification/planned_experiment.hpp"
#include "control/responses/closed_loop.hpp"
#include "control/responses/margins.hpp"
#include "control/search/motor_fit.hpp"
#include "control/tuning/robustness.hpp"
#include "control/tuning/tune.hpp"
#include "server/runtime/result.hpp"

namespace server::analysis {

using OrderedJson = nlohmann::ordered_json;  // keys in the order in which a person reads them

// bad_request for a wrong shape, invalid for a value out of range; the detail names key, value and what is allowed.
Result<control::FractionalModel> model_from(const nlohmann::json& value);
Result<control::FopdController> controller_from(const nlohmann::json& value);
// How well an identification knows the parameters of its model, with what it doubts counted: each sigma times the
// widening of doubts.hpp. None where it does not know one of them, or nobody knows the widening, and for a model that
// was written by hand. The sd of the dead time is that of the fit and of its doubt.
Result<std::optional<control::ExpectedUncertainty>> uncertainty_from(const nlohmann::json& fit);

// The doubts of an identification about its model.
struct ModelDoubts {
  bool is_of_fit = false;  // else the model was written by hand
  bool are_known = false;  // false: by hand, or a version that did not say has made it
  std::vector<control::Doubt> doubts;
};
Result<ModelDoubts> doubts_from(const nlohmann::json& fit);
// In one line, for what is computed from the model; empty: nothing is doubted that widens it.
std::string doubts_in_words(const ModelDoubts& known);

// The same of a model that is kept, or of the one that a kept controller was tuned for. Empty also where nobody has
// said.
std::string doubts_about_model(const nlohmann::json& design);

// The grave ones in one line; of a fit whose doubts are not known that they are not; empty: none is.
std::string grave_doubts_in_words(const ModelDoubts& known);

const char* text(control::Structure value);
const char* text(control::Cost value);
const char* text(control::SearchEnd value);
const char* text(control::DiscretisationMethod value);
const char* text(control::DoubtCode value);

OrderedJson json_of(const control::FractionalModel& model);
OrderedJson json_of(const control::FopdController& controller);
OrderedJson json_of(const control::HydrodynamicParameters& parameters);
OrderedJson json_of(const control::HydrodynamicModel& model);
OrderedJson json_of(const control::MotorFit& fit);
OrderedJson json_of(const control::Margins& margins);
OrderedJson json_of(std::span<const control::BodePoint> points);  // one array per column
OrderedJson json_of(const control::TunedController& tuned);
OrderedJson json_of(const control::TuningResult& result);
OrderedJson json_of(const control::EstimatorModel& model);  // without parameters if it is refused
OrderedJson json_of(const control::Fit& fit);
OrderedJson json_of(std::span<const control::Doubt> doubts);  // a list; `text` of each is for people
OrderedJson json_of(const control::Identification& identification);
OrderedJson json_of(const control::ExpectedUncertainty& uncertainty);
OrderedJson json_of(const control::ParallelSections& sections);
OrderedJson json_of(const control::Discretisation& discretisation);
OrderedJson json_of(const control::StepMetrics& metrics);
OrderedJson json_of(const control::ClosedLoopPrediction& prediction);  // metrics and every sample
OrderedJson json_of(const control::RobustnessTable& table);

// ln p of the poles as 1/s, upper half plane first; real poles of integer orders too.
OrderedJson poles_json(const control::FractionalModel& model);

}  // namespace server::analysis
