// Metrics of recording, TLS and failures for Prometheus: text format 0.0.4.
//
//   # HELP rheonaut_samples_written_total Samples that are durable.
//   # TYPE rheonaut_samples_written_total counter
//   rheonaut_samples_written_total 4711
#pragma once

#include <string>

#include "server/net/transport_security.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/station/station.hpp"
#include "server/storage/recording_parts.hpp"

namespace server::api {

std::string metrics_text(const storage::RecordingParts& recording, const station::Station& station,
                         const net::TransportSecurity& security, const runtime::ExceptionLog& exceptions);

}  // namespace server::api
