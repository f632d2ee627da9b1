// One line of text a figure; labels are ours, so there is nothing to quote.
#include "server/api/routes/metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string_view>

#include "server/net/transport_security.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/loop_lateness.hpp"
#include "server/station/station.hpp"
#include "server/storage/recording_parts.hpp"

namespace server::api {
namespace {

constexpr double kUsPerS = 1e6;

class Metrics {
 public:
  void counter(std::string_view name, std::uint64_t value, std::string_view meaning) {
    add(name, "counter", fmt::to_string(value), meaning);
  }
  void gauge(std::string_view name, std::uint64_t value, std::string_view meaning) {
    add(name, "gauge", fmt::to_string(value), meaning);
  }
  // Each bound, the sum and the count; `label` is `stage="sent"` or nothing. Divided by `scale`: µs become seconds, as
  // Prometheus wants them.
  template <class Counts>
  void histogram(std::string_view name, std::string_view label, const Counts& counted, double scale) {
    std::uint64_t count = 0;
    for (std::size_t at = 0; at < counted.counts().size(); ++at) {
      count += counted.counts()[at];
      const std::string bound =
          at == Counts::kBounds.size() ? "+Inf" : fmt::to_string(static_cast<double>(Counts::kBounds[at]) / scale);
      const std::string_view comma = label.empty() ? "" : ",";
      fmt::format_to(std::back_inserter(text_), "rheonaut_{}_bucket{{{}{}le=\"{}\"}} {}\n", name, label, comma, bound,
                     count);
    }
    const std::string labels = label.empty() ? "" : fmt::format("{{{}}}", label);
    fmt::format_to(std::back_inserter(text_), "rheonaut_{0}_sum{1} {2}\nrheonaut_{0}_count{1} {3}\n", name, labels,
                   static_cast<double>(counted.sum()) / scale, count);
  }
  void times(std::string_view name, const runtime::TimeHistogram& counted, std::string_view meaning) {
    heading(name, "histogram", meaning);
    histogram(name, "", counted, kUsPerS);
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
  metrics.gauge("tls_certificate_not_after_seconds", static_cast<std::uint64_t>(not_after_s),
                "When it expires, UTC since 1970.");
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

// Robots that are retired or were removed count nowhere.
void add_robots(Metrics& metrics, const station::Station& station) {
  std::uint64_t connected = 0, unconfirmed = 0, closed = 0;
  for (const auto& [id, robot] : station.robots()) {
    const bool is_connected = robot.link == station::LinkState::connected;
    connected += is_connected ? 1 : 0;
    unconfirmed += robot.pending_stop && robot.retired_at_us == 0 ? 1 : 0;
    closed += is_connected && robot.stop_path.is_measured && !robot.stop_path.is_open ? 1 : 0;
  }
  metrics.gauge("robots_connected", connected, "Robots that are connected now.");
  metrics.gauge("stops_unconfirmed", unconfirmed, "Robots with an emergency stop that they have not confirmed.");
  metrics.gauge("stop_paths_closed", closed, "Connected robots that a stop would not reach now, as their probes say.");
  metrics.times("link_round_trip_seconds", station.round_trips(),
                "Of heartbeats: to a robot and back, without its own time.");
  const station::StopTimes& stops = station.stop_times();
  constexpr const char* kStopTimes = "emergency_stop_seconds";
  metrics.heading(kStopTimes, "histogram", "From the request to each stage of an emergency stop of a connected robot.");
  metrics.histogram(kStopTimes, R"(stage="sent")", stops.sent, kUsPerS);
  metrics.histogram(kStopTimes, R"(stage="acknowledged")", stops.acknowledged, kUsPerS);
  metrics.histogram(kStopTimes, R"(stage="duty_zero_seen")", stops.verified, kUsPerS);
}

}  // namespace

std::string metrics_text(const RecordingRoutes& parts) {
  const storage::RecordingParts& recording = parts.recording;
  const station::Station& station = parts.station;
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
  metrics.counter("samples_given_up_total", counters.samples_given_up,
                  "Of those, samples whose robot did not come back.");
  metrics.counter("samples_returned_total", counters.samples_returned,
                  "Samples that were given up, and with which their robot came back.");
  metrics.counter("samples_purged_total", retention.samples_purged, "Samples that retention removed.");
  metrics.counter("events_purged_total", retention.events_purged, "Events that retention removed.");
  metrics.counter("records_refused_total", counters.records_refused, "Events and commands not recorded.");
  metrics.counter("batches_malformed_total", counters.batches_malformed, "Frames of samples that cannot be.");
  metrics.counter("events_left_out_total", station.events_left_out(),
                  "Events that were not recorded, since a robot sent too many.");
  metrics.counter("invalid_values_total", station.invalid_values(), "Values of robots' frames that cannot be.");
  metrics.counter("commits_total", counters.commits, "Commits.");
  metrics.counter("commits_failed_total", counters.commits_failed, "Commits that failed and were tried again.");
  metrics.times("commit_seconds", counters.commit_times, "From the beginning of a commit until it is durable.");
  constexpr const char* kDepth = "queued_samples_at_commit";
  metrics.heading(kDepth, "histogram", "Samples received and not durable when a commit begins.");
  metrics.histogram(kDepth, "", counters.samples_at_commit, 1);
  add_robots(metrics, station);
  metrics.times("loop_lateness_seconds", parts.lateness.times(),
                "How late a timer of the loop wakes, four times a second.");
  add_security(metrics, parts.security);
  add_exceptions(metrics, parts.exceptions);
  return std::move(metrics).text();
}

}  // namespace server::api
