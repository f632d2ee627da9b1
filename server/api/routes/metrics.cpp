// One line of text a figure; labels are ours, so there is nothing to quote.
#include "server/api/routes/metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string_view>

namespace server::api {
namespace {

class Metrics {
 public:
  void counter(std::string_view name, std::uint64_t value, std::string_view meaning) {
    add(name, "counter", fmt::to_string(value), meaning);
  }
  void gauge(std::string_view name, std::uint64_t value, std::string_view meaning) {
    add(name, "gauge", fmt::to_string(value), meaning);
  }
  // In seconds, as Prometheus wants it.
  void histogram(std::string_view name, std::string_view stage, const station::Histogram& times) {
    constexpr double kUsPerS = 1e6;
    const auto line = [&](std::string_view suffix, std::string_view bound, auto value) {
      fmt::format_to(std::back_inserter(text_), "rheonaut_{}{}{{stage=\"{}\"{}}} {}\n", name, suffix, stage, bound,
                     value);
    };
    std::uint64_t count = 0;
    for (std::size_t at = 0; at < times.counts().size(); ++at) {
      count += times.counts()[at];
      const bool is_last = at == station::Histogram::kBoundsUs.size();
      const std::string bound =
          is_last ? "+Inf" : fmt::to_string(static_cast<double>(station::Histogram::kBoundsUs[at]) / kUsPerS);
      line("_bucket", fmt::format(",le=\"{}\"", bound), count);
    }
    line("_sum", "", static_cast<double>(times.sum_us()) / kUsPerS);
    line("_count", "", count);
  }
  void labelled(std::string_view name, std::string_view label, std::string_view of, std::uint64_t value) {
    fmt::format_to(std::back_inserter(text_), "rheonaut_{}{{{}=\"{}\"}} {}\n", name, label, of, value);
  }
  void heading(std::string_view name, std::string_view type, std::string_view meaning) {
    fmt::format_to(std::back_inserter(text_), "# HELP rheonaut_{0} {1}\n# TYPE rheonaut_{0} {2}\n", name, meaning,
                   type);
  }
  std::string text() && { return std::move(text_); }

 private:
  void add(std::string_view name, const char* type, const std::string& value, std::string_view meaning) {
    heading(name, type, meaning);
    fmt::format_to(std::back_inserter(text_), "rheonaut_{} {}\n", name, value);
  }
  std::string text_;
};

void add_port(Metrics& metrics, const std::string& port, const net::ConnectionLimiter& limiter) {
  metrics.gauge(port + "_connections", limiter.connections(), "Open now.");
  metrics.counter(port + "_connections_refused_total", limiter.counters().refused, "No place was left for them.");
  metrics.counter(port + "_connections_replaced_total", limiter.counters().replaced, "They gave way to others.");
}

void add_security(Metrics& metrics, const net::TransportSecurity& security) {
  add_port(metrics, "http", security.http().limiter);
  add_port(metrics, "robot", security.robots().limiter);
  metrics.gauge("exposed", security.is_exposed() ? 1 : 0, "1 while a port speaks plain TCP beyond this machine.");
  const tls::TlsHandshakes* handshakes = security.handshakes();
  if (handshakes == nullptr) return;
  const auto not_after_s = std::max<std::int64_t>(handshakes->context().certificate.not_after_us / 1'000'000, 0);
  metrics.gauge("tls_certificate_not_after_s", static_cast<std::uint64_t>(not_after_s), "End of its life, UTC.");
  metrics.counter("tls_handshakes_total", handshakes->counters().handshakes,
                  "Connections that are in TLS now, or were.");
  metrics.counter("tls_resumed_total", handshakes->counters().resumed, "Of them, those that resumed a session.");
  metrics.counter("tls_failed_total", handshakes->counters().failed, "Handshakes that failed.");
}

void add_exceptions(Metrics& metrics, const runtime::ExceptionLog& exceptions) {
  constexpr const char* kName = "exceptions_total";
  metrics.heading(kName, "counter", "What ended by a fault of the station; its log says which.");
  for (const runtime::Ended ended : runtime::kAllEnded)
    metrics.labelled(kName, "where", text(ended), exceptions.count(ended));
}

}  // namespace

std::string metrics_text(const storage::RecordingParts& recording, const station::Station& station,
                         const net::TransportSecurity& security, const runtime::ExceptionLog& exceptions) {
  const storage::RecorderCounters& counters = recording.recorder.counters();
  const storage::DiskUse& use = recording.disk_watch.use();
  const storage::RetentionCounters& retention = recording.retention.counters();
  Metrics metrics;
  metrics.gauge("recording_failing", recording.recorder.failing() ? 1 : 0, "1 while nothing becomes durable.");
  metrics.gauge("space_state", static_cast<std::uint64_t>(recording.disk_watch.state()), "0 ok, 1 low, 2 critical.");
  metrics.gauge("queued_samples", recording.recorder.queued_samples(), "Received and not durable yet.");
  metrics.gauge("free_bytes", use.free_bytes, "On the disk of the database.");
  metrics.gauge("database_bytes", use.database_bytes, "Of the database file.");
  const storage::WalState& wal = recording.recorder.wal();
  metrics.gauge("wal_bytes", wal.bytes, "In use in the write-ahead log.");
  metrics.gauge("wal_held", wal.held_since_us == 0 ? 0 : 1,
                "1 while another program keeps the log from beginning anew.");
  metrics.gauge("store_losses", recording.head_watch.losses().size(),
                "Times that the database was behind its head, and nobody has acknowledged it.");
  metrics.counter("checkpoints_total", wal.checkpoints, "Passes that moved the log into the database.");
  metrics.counter("samples_written_total", counters.samples_written, "Samples that became durable.");
  metrics.counter("samples_duplicate_total", counters.samples_duplicate, "Samples that were received again.");
  metrics.counter("samples_refused_total", counters.samples_refused, "Samples that the full queue did not take.");
  metrics.counter("samples_lost_total", counters.samples_lost, "Samples in gaps that were noted.");
  metrics.counter("samples_purged_total", retention.samples_purged, "Samples that retention removed.");
  metrics.counter("records_refused_total", counters.records_refused, "Events and commands not recorded.");
  metrics.counter("batches_malformed_total", counters.batches_malformed, "Frames of samples that cannot be.");
  metrics.counter("invalid_values_total", station.invalid_values(), "Values of robots' frames that cannot be.");
  metrics.counter("commits_total", counters.commits, "Commits.");
  metrics.counter("commits_failed_total", counters.commits_failed, "Commits that failed and were tried again.");
  const station::StopTimes& stops = station.stop_times();
  constexpr const char* kStopTimes = "emergency_stop_seconds";
  metrics.heading(kStopTimes, "histogram", "From the request to each stage of an emergency stop of a connected robot.");
  metrics.histogram(kStopTimes, "sent", stops.sent);
  metrics.histogram(kStopTimes, "acknowledged", stops.acknowledged);
  metrics.histogram(kStopTimes, "duty_zero_seen", stops.verified);
  add_security(metrics, security);
  add_exceptions(metrics, exceptions);
  return std::move(metrics).text();
}

}  // namespace server::api
