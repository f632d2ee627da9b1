// Gives the experiments with `until` their fits: each is a job `identify` of the station, as anybody could ask for it.
//
// A fit ends within 15 minutes, its wait behind the jobs of others included. All of what it works with outlives the
// loop's run().
#pragma once

#include <string>

namespace server::runtime {
class Clock;
}  // namespace server::runtime

namespace server::analysis {
class AnalysisService;
}  // namespace server::analysis

namespace server::storage {
class Jobs;
}  // namespace server::storage

namespace server::experiments {
class Experiments;
struct FitRequest;
}  // namespace server::experiments

namespace server::api {

struct FitParts {
  runtime::Clock& clock;
  analysis::AnalysisService& analysis;
  storage::Jobs& jobs;
};
void connect_fits(experiments::Experiments& experiments, FitParts parts);

// The body of POST /api/v1/jobs that asks for it.
std::string fit_body(const experiments::FitRequest& request);

}  // namespace server::api
