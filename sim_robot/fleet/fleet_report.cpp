// Writes what a fleet did as text and as JSON.
#include "sim_robot/fleet/fleet_report.hpp"

#include <sys/resource.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace sim_robot {
namespace {

using Json = nlohmann::ordered_json;

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
}

constexpr std::uint64_t kMissedShare = 20;  // one tick in 20 may be skipped

double per_second(std::uint64_t from, std::uint64_t to, double dt_s) {
  return dt_s > 0 ? static_cast<double>(to - from) / dt_s : 0;
}

double rounded(double value, double decimal) { return std::round(value / decimal) / std::round(1 / decimal); }

Json late_ms(const Lateness& lateness) {
  return {{"p50", lateness.quantile_ms(0.5)}, {"p99", lateness.quantile_ms(0.99)}, {"max", lateness.max_ms()}};
}

std::string plain(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_object()) return value.dump();
  std::string text;
  for (const auto& [key, part] : value.items()) text += (text.empty() ? "" : ", ") + key + " " + part.dump();
  return text;
}

Json rates(const FleetSnapshot& from, const FleetSnapshot& to, const Lateness& lateness) {
  const double dt_s = to.time_s - from.time_s;
  const auto rate = [dt_s](std::uint64_t a, std::uint64_t b) { return rounded(per_second(a, b, dt_s), 1); };
  const SampleCounts &before = from.counts.samples, &now = to.counts.samples;
  return {{"time_s", rounded(to.time_s, 0.1)},
          {"connected", to.counts.connected},
          {"made_per_s", rate(before.made, now.made)},
          {"sent_per_s", rate(before.sent, now.sent)},
          {"acknowledged_per_s", rate(before.acknowledged, now.acknowledged)},
          {"frames_per_s", rate(from.counts.links.frames, to.counts.links.frames)},
          {"resent_per_s", rate(before.resent, now.resent)},
          {"held", now.held},
          {"lost", now.lost},
          {"gaps", now.gaps},
          {"tick_late_ms_p99", lateness.quantile_ms(0.99)},
          {"cpu_cores", rounded(dt_s > 0 ? (to.cpu_s - from.cpu_s) / dt_s : 0, 0.001)}};
}

Json acknowledged_after_ms(const FleetSnapshot& end) {
  return end.acknowledged_after ? late_ms(*end.acknowledged_after) : Json{};
}

Json summary(const FleetSnapshot& end, const Lateness& lateness, const std::string& fault) {
  const FleetCounts& counts = end.counts;
  const SampleCounts& samples = counts.samples;
  const auto made = static_cast<double>(samples.made);
  return {{"duration_s", rounded(end.time_s, 0.01)},
          {"robots", counts.robots},
          {"robots_booted", counts.booted},
          {"robots_welcomed", counts.welcomed},
          {"samples_made", samples.made},
          {"samples_sent", samples.sent},
          {"samples_acknowledged", samples.acknowledged},
          {"samples_held", samples.held},
          {"samples_unsettled", end.unsettled},
          {"samples_lost", samples.lost},
          {"samples_resent", samples.resent},
          {"gaps", samples.gaps},
          {"frames_sent", counts.links.frames},
          {"reconnects", counts.reconnects},
          {"refusals", counts.links.refusals},
          {"refusal", counts.refusal},
          {"connections", counts.links.opened},
          {"unreachable", counts.links.unreachable},
          {"commands", samples.commands},
          {"missed_ticks", samples.missed_ticks},
          {"tick_late_ms", late_ms(lateness)},
          {"acknowledged_after_ms", acknowledged_after_ms(end)},
          {"cpu_s", rounded(end.cpu_s, 0.001)},
          {"cpu_us_per_sample", rounded(made > 0 ? end.cpu_s * 1e6 / made : 0, 0.001)},
          {"result", fault.empty() ? "nothing lost" : fault}};
}

}  // namespace

double process_cpu_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

std::string rates_json(const FleetSnapshot& from, const FleetSnapshot& to, const Lateness& lateness) {
  return rates(from, to, lateness).dump();
}

std::string rates_text(const FleetSnapshot& from, const FleetSnapshot& to, const Lateness& lateness) {
  const Json values = rates(from, to, lateness);
  const auto number = [&values](const char* key) { return values[key].get<double>(); };
  std::array<char, 240> line;
  std::snprintf(line.data(), line.size(),
                "%6.1f s  connected %5.0f  made/s %7.0f  sent/s %7.0f  acked/s %7.0f  resent/s %5.0f  held %7.0f  "
                "lost %5.0f  gaps %4.0f  late p99 %7.3f ms  cpu %5.3f",
                number("time_s"), number("connected"), number("made_per_s"), number("sent_per_s"),
                number("acknowledged_per_s"), number("resent_per_s"), number("held"), number("lost"), number("gaps"),
                number("tick_late_ms_p99"), number("cpu_cores"));
  return line.data();
}

std::string summary_json(const FleetSnapshot& end, const Lateness& lateness, const std::string& fault) {
  return summary(end, lateness, fault).dump() + '\n';
}

std::string summary_text(const FleetSnapshot& end, const Lateness& lateness, const std::string& fault) {
  std::string text;
  for (const auto& [key, value] : summary(end, lateness, fault).items()) {
    text += key + std::string(22 - key.size(), ' ') + plain(value) + '\n';
  }
  return text;
}

std::optional<FleetFault> fleet_fault(const FleetSnapshot& end) {
  const FleetCounts& counts = end.counts;
  const SampleCounts& samples = counts.samples;
  const std::string robots = std::to_string(counts.robots);
  if (counts.booted < counts.robots) {
    return FleetFault{1, "ended when " + std::to_string(counts.booted) + " of " + robots + " robots had booted"};
  }
  if (counts.welcomed == 0) {
    if (counts.links.refusals > 0) return FleetFault{2, "the station refused every robot: " + counts.refusal};
    return FleetFault{2, counts.links.opened > 0
                             ? "every connection ended before its welcome: is this the robots' port?"
                             : "no robot ever reached the station"};
  }
  if (counts.welcomed < counts.robots) {
    return FleetFault{1, std::to_string(counts.robots - counts.welcomed) + " of " + robots + " robots never got in"};
  }
  if (samples.lost > 0) {
    return FleetFault{1, std::to_string(samples.lost) + " samples lost in " + std::to_string(samples.gaps) + " gaps"};
  }
  if (end.unsettled > 0) {
    return FleetFault{1, std::to_string(end.unsettled) + " samples not acknowledged after the end"};
  }
  if (samples.missed_ticks > samples.made / kMissedShare) {
    return FleetFault{1,
                      std::to_string(samples.missed_ticks) + " ticks skipped: this machine is too slow for the fleet"};
  }
  return std::nullopt;
}

}  // namespace sim_robot
