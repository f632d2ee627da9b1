// The routes of what is computed from runs, grouped by noun: routes_jobs, routes_designs, routes_run_metrics,
// routes_capsule.
//
// As in server/api/routes/routes.hpp: all of what they work with outlives the router.
#pragma once

#include "server/api/routes/routes.hpp"

namespace server::storage {
class Designs;
class Jobs;
class MetricsOfRuns;
}  // namespace server::storage

namespace server::api {

struct DesignRoutes {
  runtime::Clock& clock;
  storage::Designs& designs;
  storage::Jobs& jobs;
};
void add_design_routes(http::Router& router, DesignRoutes parts);

struct JobRoutes {
  analysis::AnalysisService& analysis;
  storage::FluidModels& fluid_models;
  storage::Jobs& jobs;
  storage::Runs& runs;
};
void add_job_routes(http::Router& router, JobRoutes parts);

struct RunMetricsRoutes {
  analysis::AnalysisService& analysis;
  runtime::Clock& clock;
  storage::RunDigester& digester;
  storage::History& history;
  storage::MetricsOfRuns& metrics;
  storage::Runs& runs;
};
void add_run_metrics_routes(http::Router& router, RunMetricsRoutes parts);

struct CapsuleRoutes {
  storage::Designs& designs;
  ExportRoutes exports;
  RunMetricsRoutes of_runs;
};
void add_capsule_routes(http::Router& router, CapsuleRoutes parts);

}  // namespace server::api
