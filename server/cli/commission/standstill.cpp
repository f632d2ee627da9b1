// The bounds, and the sentences.
#include "server/cli/commission/standstill.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace server::cli {
namespace {

constexpr std::size_t kFewestSamples = 200;

// SAFETY: the station shows the way of a stop as closed when a probe needs longer; a stop should be as fast.
constexpr double kSlowStopMs = 250;

// BNO055: 150 µg/√Hz over 62.5 Hz, and readings in steps of 0.01 m/s².
constexpr double kDataSheetNoiseMS2 = 0.0116, kCountMS2 = 0.01;
constexpr double kLeastNoiseMS2 = 0.002;       // a count over √12 is 0.0029: below it nothing is measured
constexpr double kNoisy = 1.5, kTooNoisy = 4;  // times what the estimator assumes
constexpr double kDriftMS2 = kCountMS2;        // of the mean, between both halves

constexpr double kOpenMv = 20, kSaturatedMv = 1000;        // what the robot itself counts as a fault
constexpr double kNoisyShare = 0.2, kTooNoisyShare = 0.5;  // of the band within which nothing is detected

StepFinding missing_samples(const char* step, std::size_t count) {
  return {.step = step,
          .verdict = Verdict::fail,
          .found = fmt::format("only {} samples came", count),
          .bound = fmt::format("at least {}", kFewestSamples),
          .action = "see whether samples are lost (rheonaut watch), and begin again"};
}

}  // namespace

double mean_of(const std::vector<double>& values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double sd_of(const std::vector<double>& values) {
  if (values.size() < 2) return 0;
  const double mean = mean_of(values);
  double squares = 0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

StepFinding judge_versions(const VersionFacts& facts) {
  StepFinding finding{
      .step = "versions",
      .verdict = Verdict::pass,
      .found = fmt::format("firmware {}, station {}; last reset: {}", facts.firmware, facts.station, facts.reset_cause),
      .bound = "firmware and station of one version; the sensor calibrated to 3 of 3"};
  finding.figures = {{"firmware_version", facts.firmware},
                     {"station_version", facts.station},
                     {"program_version", facts.program},
                     {"reset_cause", facts.reset_cause},
                     {"imu_calibration", facts.has_status ? nlohmann::ordered_json(facts.imu_calibration) : nullptr}};
  const std::string version = facts.firmware.substr(facts.firmware.rfind('-') + 1);  // all of it where there is no '-'
  if (version != facts.station) {
    finding.verdict = Verdict::attention;
    finding.action = "flash the robot with the firmware that belongs to this station (docs/hardware.md, Flashing)";
  } else if (facts.reset_cause == "watchdog" || facts.reset_cause == "brown_out") {
    finding.verdict = Verdict::attention;
    finding.action = "find out why the robot reset by itself: a weak battery, or a program that hung";
  } else if (!facts.has_status) {
    finding.verdict = Verdict::attention;
    finding.found += "; the sensor's calibration is not known";
    finding.action = "the robot has sent no status: see to the link, and begin again";
  } else if (facts.imu_calibration < 3) {
    finding.verdict = Verdict::attention;
    finding.found += fmt::format("; the sensor's calibration is {} of 3", facts.imu_calibration);
    finding.action = "calibrate the sensor (docs/hardware.md, Calibration), and begin again";
  }
  return finding;
}

double worst_stop_ms(const StopFacts& facts) {
  return facts.confirmed_ms.empty() ? 0 : std::ranges::max(facts.confirmed_ms);
}

StepFinding judge_stops(const StopFacts& facts) {
  StepFinding finding{
      .step = "stop_latency",
      .bound = fmt::format("every stop confirmed by the robot, the slowest within {:.0f} ms", kSlowStopMs)};
  std::vector<double> sorted = facts.confirmed_ms;
  std::ranges::sort(sorted);
  finding.figures = {{"stops", facts.asked}, {"confirmed", sorted.size()}, {"confirmed_ms", facts.confirmed_ms}};
  finding.figures["probe_round_trip_ms"] =
      facts.round_trip_ms ? nlohmann::ordered_json(*facts.round_trip_ms) : nlohmann::ordered_json(nullptr);
  if (facts.asked == 0 || sorted.size() < facts.asked || !facts.not_confirmed.empty()) {
    finding.verdict = Verdict::fail;
    finding.found = fmt::format("{} of {} stops confirmed; {}", sorted.size(), facts.asked,
                                facts.not_confirmed.empty() ? "the rest is missing" : facts.not_confirmed);
    finding.action = "switch the robot off by hand; see to its link before the motor runs (docs/troubleshooting.md)";
    return finding;
  }
  const double median_ms = sorted[sorted.size() / 2];
  finding.figures["median_ms"] = median_ms;
  finding.figures["worst_ms"] = sorted.back();
  finding.found = fmt::format("{} of {} stops confirmed by the robot; median {:.1f} ms, slowest {:.1f} ms",
                              sorted.size(), facts.asked, median_ms, sorted.back());
  finding.verdict = sorted.back() <= kSlowStopMs ? Verdict::pass : Verdict::attention;
  if (finding.verdict != Verdict::pass) {
    finding.action =
        "bring the access point nearer, or choose another channel; the robot swims on until the stop arrives";
  }
  return finding;
}

StepFinding judge_imu_noise(const RestFacts& facts) {
  const auto& values = facts.acceleration_m_s2;
  if (values.size() < kFewestSamples) return missing_samples("imu_noise", values.size());
  const auto half = static_cast<std::ptrdiff_t>(values.size() / 2);
  const double sd = sd_of(values), mean = mean_of(values);
  const double drift =
      mean_of({values.begin() + half, values.end()}) - mean_of({values.begin(), values.begin() + half});
  const double most = kNoisy * facts.expected_noise_m_s2, far_too_much = kTooNoisy * facts.expected_noise_m_s2;
  StepFinding finding{
      .step = "imu_noise",
      .verdict = Verdict::pass,
      .found = fmt::format("noise sd {:.4f} m/s², mean {:+.4f} m/s² after the robot's own bias, {} samples", sd, mean,
                           values.size()),
      .bound =
          fmt::format("sd from {:.3f} to {:.4f} m/s², {} times what the estimator assumes ({:.3f}; the BNO055's data "
                      "sheet: {:.4f}); mean within {:.2f}",
                      kLeastNoiseMS2, most, kNoisy, facts.expected_noise_m_s2, kDataSheetNoiseMS2, kDriftMS2)};
  finding.figures = {{"samples", values.size()},
                     {"sd_m_s2", sd},
                     {"mean_m_s2", mean},
                     {"drift_m_s2", drift},
                     {"expected_sd_m_s2", facts.expected_noise_m_s2},
                     {"data_sheet_sd_m_s2", kDataSheetNoiseMS2}};
  if (facts.has_sensor_fault) {
    finding.verdict = Verdict::fail;
    finding.action = "the robot reports a sensor fault: see to the sensor's wires (docs/hardware.md, Wiring)";
  } else if (sd < kLeastNoiseMS2) {
    finding.verdict = Verdict::fail;
    finding.action = "the readings hardly change, as no real sensor's do: is it stuck?";
  } else if (sd > far_too_much) {
    finding.verdict = Verdict::fail;
    finding.action = "is the robot at rest, the pump off, the sensor fixed to the hull? Then replace the sensor";
  } else if (sd > most) {
    finding.verdict = Verdict::attention;
    finding.action = fmt::format("let the robot lie still; if it stays so, set acceleration_noise_m_s2 to {:.3f}", sd);
  } else if (std::abs(mean) > kDriftMS2 || std::abs(drift) > kDriftMS2) {
    finding.verdict = Verdict::attention;
    finding.found += fmt::format("; its mean moved by {:+.4f} m/s²", drift);
    finding.action = "the bias wanders: let the sensor warm up for some minutes, and begin again";
  }
  return finding;
}

StepFinding judge_electrode(const RestFacts& facts) {
  const auto& values = facts.impedance_mv;
  if (values.size() < kFewestSamples) return missing_samples("electrode", values.size());
  const double sd = sd_of(values), mean = mean_of(values);
  StepFinding finding{
      .step = "electrode",
      .verdict = Verdict::pass,
      .found = fmt::format("{:.1f} mV, noise sd {:.1f} mV, {} samples", mean, sd, values.size()),
      .bound = fmt::format("{:.0f} ± {:.0f} mV, the level within which the robot detects nothing; sd up to {:.1f} mV",
                           facts.nominal_mv, facts.band_mv, kNoisyShare * facts.band_mv)};
  finding.figures = {{"samples", values.size()},
                     {"mean_mv", mean},
                     {"sd_mv", sd},
                     {"nominal_mv", facts.nominal_mv},
                     {"band_mv", facts.band_mv}};
  if (mean < kOpenMv || mean > kSaturatedMv) {
    finding.verdict = Verdict::fail;
    finding.found += mean < kOpenMv ? ": open, or not connected" : ": saturated";
    finding.action = "see to the electrode's amplifier and its wire to A0 (docs/hardware.md, Wiring)";
  } else if (sd > kTooNoisyShare * facts.band_mv) {
    finding.verdict = Verdict::fail;
    finding.found += ": noisy";
    finding.action =
        "the robot would detect glucose where there is none: shield the wire, see to the amplifier's ground";
  } else if (sd > kNoisyShare * facts.band_mv) {
    finding.verdict = Verdict::attention;
    finding.found += ": noisy";
    finding.action = "shield the electrode's wire; look at the impedance while the motor runs";
  } else if (std::abs(mean - facts.nominal_mv) > facts.band_mv) {
    finding.verdict = Verdict::attention;
    finding.found += ": not the nominal level";
    finding.action = fmt::format(
        "calibrate impedance_scale (docs/hardware.md, Calibration), or set impedance_nominal_mv to "
        "{:.0f} if this is the level of your fluid without glucose",
        mean);
  } else if (sd == 0) {
    finding.verdict = Verdict::attention;
    finding.found += ": it never changes, as no real electrode does";
    finding.action = "touch the electrode, and see whether the level moves (rheonaut watch)";
  }
  return finding;
}

}  // namespace server::cli
