// The job `identify`: a model from one or several recorded runs, tried on another run and beside the model in use.
//
// Loop thread; it reads the runs page by page, and computes on the thread of the jobs.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <optional>
#include <string>
#include <vector>

#include "control/models/plant_models.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/analysis/run_recording.hpp"
#include "server/storage/jobs/job_run.hpp"

namespace server::analysis {

struct RunPart {
  storage::RunId run = 0;
  RunWindow window;
};

struct IdentifyRequest {
  std::vector<RunPart> runs;  // at least one; of several one model is found
  ChannelChoice channels = ChannelChoice::best;
  control::IdentificationOptions search;  // its on_progress is set by the job
  bool with_residuals = false;
  std::optional<RunPart> validation;  // on which the model is tried
  std::vector<std::string> warnings;  // of what is asked for, to stand among those of the result
};

// Of the fluid of the first run.
struct ModelInUse {
  std::string fluid;
  control::FractionalModel model;
};

// The answer of `rheonaut identify --json`, with `validation` and `model_in_use`, null where there is none; of several
// runs the latter has `runs`, in their order. Errors: a run that is not there, too long, or has no gapless window.
boost::asio::awaitable<Result<std::string>> identify_job(AnalysisService& analysis, IdentifyRequest request,
                                                         std::optional<ModelInUse> in_use, storage::JobRun& run);

}  // namespace server::analysis
