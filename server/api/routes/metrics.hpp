// Metrics of recording, link, stops, loop, TLS and failures for Prometheus: text format 0.0.4.
//
//   # HELP rheonaut_samples_written_total Samples that are durable.
//   # TYPE rheonaut_samples_written_total counter
//   rheonaut_samples_written_total 4711
//
// docs/operations.md lists the histograms; deploy/prometheus and deploy/grafana use the names.
#pragma once

#include <string>

#include "server/api/routes/routes.hpp"

namespace server::api {

std::string metrics_text(const RecordingRoutes& parts);

}  // namespace server::api
