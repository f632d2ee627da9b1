// Selects a window of a run and refuses what is not equally spaced.
#include "server/analysis/run_recording.hpp"

#include <fmt/format.h>

#include <cmath>

namespace server {
namespace {

constexpr std::size_t kFewestSamples = 10;

struct Piece {
  std::uint64_t span_began_us = 0;
  std::vector<StoredSample> samples;

  double seconds(const StoredSample& stored) const {
    return static_cast<double>(stored.robot_time_us - span_began_us) * 1e-6;
  }
};

Result<Piece> select(std::span<const StoredSample> samples, const RunWindow& window) {
  if (samples.empty()) return fail(ErrorCode::invalid, "the run has no samples");
  if (!window.span && samples.front().span != samples.back().span) {
    return fail(ErrorCode::invalid,
                fmt::format("the robot rebooted during the run, which has spans {} to {}; choose one with --span",
                            samples.front().span, samples.back().span));
  }
  const std::uint32_t span = window.span.value_or(samples.front().span);
  Piece piece;
  bool has_begun = false;
  for (const StoredSample& stored : samples) {
    if (stored.span != span) continue;
    if (!has_begun) piece.span_began_us = stored.robot_time_us;
    has_begun = true;
    const double at_s = piece.seconds(stored);
    if (at_s >= window.from_s && at_s <= window.to_s) piece.samples.push_back(stored);
  }
  if (piece.samples.size() < kFewestSamples) {
    return fail(ErrorCode::invalid, fmt::format("span {} has {} samples from {} to {} s; at least {} are needed", span,
                                                piece.samples.size(), window.from_s, window.to_s, kFewestSamples));
  }
  return piece;
}

std::unexpected<Error> gap_between(const StoredSample& before, const StoredSample& after, double at_s) {
  const double length_s = static_cast<double>(after.robot_time_us - before.robot_time_us) * 1e-6;
  return fail(ErrorCode::invalid,
              fmt::format("the run has a gap of {:.3f} s at {:.3f} s ({} samples after seq {} are not there); "
                          "choose a part without it with --from-s and --to-s",
                          length_s, at_s, after.seq - before.seq - 1, before.seq),
              "gap");
}

// Stored times are right to 100 us, so equal spacing is asked for within a tenth.
bool is_gap(const StoredSample& before, const StoredSample& after, double dt_s) {
  const double step_s = static_cast<double>(after.robot_time_us - before.robot_time_us) * 1e-6;
  return after.seq != before.seq + 1 || std::abs(step_s - dt_s) > 0.1 * dt_s;
}

bool is_whole(const StoredSample& stored, const RunWindow& window) {
  const Sample& sample = stored.sample;
  return std::isfinite(sample.position_m) && std::isfinite(stored.disturbance_m) && std::isfinite(sample.duty) &&
         (!window.with_velocity || std::isfinite(sample.velocity_m_s));
}

std::unexpected<Error> incomplete(const StoredSample& stored, double at_s) {
  return fail(ErrorCode::invalid,
              fmt::format("sample seq {} at {:.3f} s lacks a value (duty {}, position_m {}, velocity_m_s {}); choose a "
                          "part without it with --from-s and --to-s",
                          stored.seq, at_s, stored.sample.duty, stored.sample.position_m, stored.sample.velocity_m_s));
}

}  // namespace

StepPoint step_point(const StoredSample& stored) {
  StepPoint point;
  point.span = stored.span;
  point.seq = stored.seq;
  point.robot_time_us = stored.robot_time_us;
  point.position_m = stored.sample.position_m;
  point.disturbance_m = stored.disturbance_m;
  point.setpoint_m = stored.setpoint_m.value_or(0);
  point.steered = stored.mode == rheonaut_MODE_AUTO && stored.setpoint_m.has_value();
  return point;
}

Result<control::Recording> recording_of(std::span<const StoredSample> samples, const RunWindow& window) {
  const auto piece = select(samples, window);
  if (!piece) return std::unexpected{piece.error()};
  const auto& chosen = piece->samples;
  control::Recording recording;
  recording.dt_s =
      (piece->seconds(chosen.back()) - piece->seconds(chosen.front())) / static_cast<double>(chosen.size() - 1);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const StoredSample& stored = chosen[i];
    const double at_s = piece->seconds(stored);
    if (i > 0 && is_gap(chosen[i - 1], stored, recording.dt_s)) return gap_between(chosen[i - 1], stored, at_s);
    if (!is_whole(stored, window)) return incomplete(stored, at_s);
    recording.duty.push_back(static_cast<double>(stored.sample.duty));
    recording.position_m.push_back(static_cast<double>(stored.sample.position_m) -
                                   static_cast<double>(stored.disturbance_m));
    if (window.with_velocity) recording.velocity_m_s.push_back(static_cast<double>(stored.sample.velocity_m_s));
  }
  return recording;
}

}  // namespace server
