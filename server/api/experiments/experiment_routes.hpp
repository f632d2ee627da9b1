// The routes of experiments: what is queued, runs or has ended, what people do with it, and the profiles.
//
// As in server/api/routes/routes.hpp: all of what they work with outlives the router.
#pragma once

#include "server/api/routes/routes.hpp"

namespace server::experiments {
class Experiments;
}  // namespace server::experiments

namespace server::storage {
class Designs;
}  // namespace server::storage

namespace server::api {

struct ExperimentRoutes {
  runtime::Clock& clock;
  experiments::Experiments& experiments;
  station::Station& station;
};
void add_experiment_routes(http::Router& router, ExperimentRoutes parts);

// Gives the experiments the controllers of the names in their profiles: the newest kept one of a name.
struct ControllerNames {
  analysis::AnalysisService& analysis;
  storage::Designs& designs;
  station::Station& station;
};
void connect_controllers(experiments::Experiments& experiments, ControllerNames names);

}  // namespace server::api
