// The routes of what is computed from runs, grouped by noun: routes_jobs, routes_designs, routes_push,
// routes_run_metrics, routes_comparisons, routes_capsule.
//
// As in server/api/routes/routes.hpp: all of what they work with outlives the router.
#pragma once

#include "server/analysis/documents/document_jobs.hpp"
#include "server/api/routes/routes.hpp"

namespace server::storage {
class Designs;
class Jobs;
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
  storage::Designs& designs;
  analysis::DocumentJobParts documents;
  storage::FluidModels& fluid_models;
  storage::Jobs& jobs;
  storage::Runs& runs;
};
void add_job_routes(http::Router& router, JobRoutes parts);

struct PushRoutes {
  analysis::AnalysisService& analysis;
  CommandRoutes commands;
  storage::Designs& designs;
};
void add_push_routes(http::Router& router, PushRoutes parts);

// Metrics and reports of one run, and of several side by side.
struct DocumentRoutes {
  analysis::RunDocuments& documents;
};
void add_run_metrics_routes(http::Router& router, DocumentRoutes parts);
void add_comparison_routes(http::Router& router, DocumentRoutes parts);

struct CapsuleRoutes {
  analysis::AnalysisService& analysis;
  storage::Designs& designs;
  storage::RunDigester& digester;
  analysis::RunDocuments& documents;
  ExportRoutes exports;
  storage::Runs& runs;
};
void add_capsule_routes(http::Router& router, CapsuleRoutes parts);

}  // namespace server::api
