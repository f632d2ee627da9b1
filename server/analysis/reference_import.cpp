// Reads the text, finds clock and zero, and keeps what lies in the span.
#include "server/analysis/reference_import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "server/analysis/csv_columns.hpp"
#include "server/analysis/optional_json.hpp"
#include "server/analysis/reference_unit.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/sha256.hpp"

namespace server::analysis {
namespace {

constexpr std::size_t kFewestPositionsToImport = 10;
constexpr double kLeastOwnSdM = 1e-4;  // weights do not grow beyond it
constexpr double kLargestPositionM = 1e6, kLargestTimeS = 1e10;
constexpr double kLeastSdM = 1e-7;    // what is given to be surer weighs down all the others
constexpr double kLongestGapS = 0.1;  // in the robot's own record

struct Given {
  std::vector<double> time_s, position_m, sd_m;
};

// The line of a row of numbers, as csv_columns counts them.
std::size_t line_of_row(std::string_view text, std::size_t row) {
  std::size_t line = 0, rows = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view content = text.substr(begin, end - begin);
    ++line;
    begin = end + 1;
    const auto first = content.find_first_not_of(" \t\r\xEF\xBB\xBF");
    if (first == std::string_view::npos || content[first] == '#') continue;
    if (rows++ == row + 1) break;  // the first is the heading
  }
  return line;
}

constexpr double kLeastRatio = 0.2, kMostRatio = 5;  // of both motions; a robot with a wrong model is off by two

std::optional<std::string> fault_of_row(const Given& given, std::size_t row) {
  const double time_s = given.time_s[row], position_m = given.position_m[row], sd_m = given.sd_m[row];
  if (row > 0 && !(time_s > given.time_s[row - 1])) {
    return fmt::format("t_s {} is not after {}, the one before: times must ascend", time_s, given.time_s[row - 1]);
  }
  if (std::abs(time_s) > kLargestTimeS) return fmt::format("t_s {} is beyond {}: give seconds", time_s, kLargestTimeS);
  if (std::abs(position_m) > kLargestPositionM) {
    return fmt::format("position_m {} is beyond {}: give metres", position_m, kLargestPositionM);
  }
  if (!(sd_m >= kLeastSdM && sd_m <= kLargestPositionM)) {
    return fmt::format("position_sd_m {} is not from {:g} to {:g} m", sd_m, kLeastSdM, kLargestPositionM);
  }
  return std::nullopt;
}

Result<Given> read_given(const ReferenceRequest& request) {
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  if (std::ranges::any_of(request.source, is_control)) {
    return fail(ErrorCode::invalid, "source has control characters: it is a name, in one line", "out_of_range");
  }
  Given given;
  try {
    CsvColumns columns = parse_csv(request.csv, request.source, {"t_s", "position_m"}, {"position_sd_m"});
    given.time_s = std::move(columns.at("t_s"));
    given.position_m = std::move(columns.at("position_m"));
    if (const auto sd = columns.find("position_sd_m"); sd != columns.end()) given.sd_m = std::move(sd->second);
  } catch (const std::runtime_error& error) {
    return fail(ErrorCode::invalid, runtime::text_of(error), "malformed_csv");
  }
  if (given.time_s.size() > kMaxReferenceRows) {
    return fail(ErrorCode::invalid, fmt::format("{} has more than {} rows", request.source, kMaxReferenceRows),
                "too_large");
  }
  if (given.sd_m.empty() && !request.sd_m) {
    return fail(ErrorCode::invalid,
                fmt::format("{} has no column position_sd_m: say how exact its positions are, with sd_m (--sd-mm)",
                            request.source),
                "no_sd");
  }
  if (given.sd_m.empty()) given.sd_m.assign(given.time_s.size(), *request.sd_m);
  for (std::size_t row = 0; row < given.time_s.size(); ++row) {
    const auto fault = fault_of_row(given, row);
    if (!fault) continue;
    return fail(ErrorCode::invalid,
                fmt::format("{} line {}: {}", request.source, line_of_row(request.csv, row), *fault), "malformed_csv");
  }
  return given;
}

// The samples of the span that have a position, in seconds since the first of all of the span.
struct OwnRecord {
  std::uint32_t span = 0;
  std::uint64_t first_us = 0, last_us = 0;
  std::vector<double> time_s, position_m, sd_m;
  std::optional<std::int64_t> utc_offset_us;  // of the sample whose clock is known best, as its half-width
  std::int64_t utc_uncertainty_us = 0;
  std::int64_t utc_drift_us = 0;  // how far others are from it, beyond their own half-width

  double seconds(std::uint64_t robot_time_us) const {
    return (static_cast<double>(robot_time_us) - static_cast<double>(first_us)) * 1e-6;
  }
};

// A standard deviation that falls to less than half from one sample to the next: a zeroing whose event was lost.
bool is_zeroed_between(const OwnPosition& before, const OwnPosition& after) {
  constexpr float kSureM = 0.0005F;  // below it, the sd of a robot that knows its position says nothing
  return before.position_sd_m > kSureM && after.position_sd_m < before.position_sd_m / 2;
}

Error zeroed_at(double at_s) {
  return {ErrorCode::invalid,
          fmt::format("the robot's position was set to 0 (zero_position) {:.2f} s after the span began, so no one zero "
                      "holds for all of it: make runs of what lies before and after",
                      at_s),
          "zeroed"};
}

Result<OwnRecord> own_record(std::span<const OwnPosition> own, std::span<const storage::Zeroing> zeroings,
                             std::optional<std::uint32_t> wanted) {
  if (own.empty()) return fail(ErrorCode::invalid, "the run has no samples");
  if (!wanted && own.front().span != own.back().span) {
    return fail(ErrorCode::invalid,
                fmt::format("the robot rebooted during the run, which has spans {} to {}; choose one", own.front().span,
                            own.back().span),
                "several_spans");
  }
  OwnRecord record;
  record.span = wanted.value_or(own.front().span);
  bool has_begun = false;
  const OwnPosition* before = nullptr;
  for (const OwnPosition& sample : own) {
    if (sample.span != record.span) continue;
    if (before != nullptr && is_zeroed_between(*before, sample)) {
      return std::unexpected{zeroed_at(record.seconds(sample.robot_time_us))};
    }
    before = &sample;
    if (!has_begun) record.first_us = sample.robot_time_us;
    has_begun = true;
    record.last_us = sample.robot_time_us;
    const bool is_better = !record.utc_offset_us || sample.clock_uncertainty_us < record.utc_uncertainty_us;
    if (sample.clock_uncertainty_us >= 0 && is_better) {
      record.utc_offset_us = sample.utc_us - static_cast<std::int64_t>(sample.robot_time_us);
      record.utc_uncertainty_us = sample.clock_uncertainty_us;
    }
    const double time_s = record.seconds(sample.robot_time_us);
    if (!std::isfinite(sample.position_m) || (!record.time_s.empty() && !(time_s > record.time_s.back()))) continue;
    record.time_s.push_back(time_s);
    record.position_m.push_back(static_cast<double>(sample.position_m));
    record.sd_m.push_back(static_cast<double>(sample.position_sd_m));
  }
  if (!has_begun) return fail(ErrorCode::invalid, fmt::format("the run has no samples in span {}", record.span));
  for (const storage::Zeroing& zeroing : zeroings) {
    const bool is_within = zeroing.robot_time_us > record.first_us && zeroing.robot_time_us <= record.last_us;
    if (zeroing.span == record.span && is_within) {
      return std::unexpected{zeroed_at(record.seconds(zeroing.robot_time_us))};
    }
  }
  for (const OwnPosition& sample : own) {
    if (sample.span != record.span || sample.clock_uncertainty_us < 0) continue;
    const std::int64_t offset_us = sample.utc_us - static_cast<std::int64_t>(sample.robot_time_us);
    const std::int64_t beyond_us = std::abs(offset_us - *record.utc_offset_us) - sample.clock_uncertainty_us;
    record.utc_drift_us = std::max(record.utc_drift_us, beyond_us);
  }
  return record;
}

Result<void> find_clock(const ReferenceRequest& request, const Given& given, const OwnRecord& own,
                        std::optional<storage::MarkerPlace> marker, storage::OutsideReference& into) {
  const ReferenceClockRequest& asked = request.clock;
  into.clock = asked.method;
  into.clock_sd_s = asked.sd_s;
  switch (asked.method) {
    case storage::ReferenceClock::offset: into.clock_offset_s = asked.offset_s; return {};
    case storage::ReferenceClock::utc: {
      if (!own.utc_offset_us) {
        return fail(ErrorCode::invalid,
                    "the station had no estimate of the robot's clock in this span, so UTC does not "
                    "help; align the clock by correlation",
                    "no_clock");
      }
      const std::int64_t zero_us = asked.zero_at_us - *own.utc_offset_us;  // in robot time
      into.clock_offset_s = static_cast<double>(zero_us - static_cast<std::int64_t>(own.first_us)) * 1e-6;
      const double half_width_s = static_cast<double>(own.utc_uncertainty_us) * 1e-6;
      const double drift_s = static_cast<double>(own.utc_drift_us) * 1e-6;
      into.clock_sd_s = std::hypot(asked.sd_s.value_or(0), half_width_s / std::sqrt(3.0), drift_s / std::sqrt(3.0));
      return {};
    }
    case storage::ReferenceClock::marker:
      if (!marker || marker->span != own.span) {
        return fail(ErrorCode::invalid, fmt::format("the marker does not stand in span {}", own.span));
      }
      into.clock_offset_s = own.seconds(marker->robot_time_us) - asked.at_s;
      return {};
    case storage::ReferenceClock::correlation: break;
  }
  const control::ClockAlignment found =
      control::align_clocks({given.time_s, given.position_m}, {own.time_s, own.position_m}, asked.search);
  if (!found.refusal.empty()) {
    return fail(ErrorCode::invalid,
                fmt::format("the clock cannot be found by correlation: {}; give a marker, an offset, or the range in "
                            "which the offset lies",
                            found.refusal),
                "no_correlation");
  }
  if (!request.is_in_metres && (found.motion_ratio < kLeastRatio || found.motion_ratio > kMostRatio)) {
    return fail(ErrorCode::invalid,
                fmt::format("it moves {:.4g} times what the robot's own record does: {}", found.motion_ratio,
                            unit_advice(found.motion_ratio)),
                "out_of_range");
  }
  into.clock_offset_s = found.offset_s;
  into.clock_sd_s = found.offset_sd_s;
  into.correlation = found.correlation;
  into.motion_ratio = found.motion_ratio;
  return {};
}

// Of the given rows that lie in the span, on its clock.
Given rows_in_span(const Given& given, const OwnRecord& own, double offset_s) {
  Given inside;
  const double last_s = own.seconds(own.last_us);
  for (std::size_t row = 0; row < given.time_s.size(); ++row) {
    const double time_s = given.time_s[row] + offset_s;
    if (!(time_s >= 0 && time_s <= last_s)) continue;
    inside.time_s.push_back(time_s);
    inside.position_m.push_back(given.position_m[row]);
    inside.sd_m.push_back(given.sd_m[row]);
  }
  return inside;
}

struct OwnAt {
  double position_m = 0, sd_m = 0;
};

// Between two samples; none beyond the record, in a gap, or where the robot does not know.
std::optional<OwnAt> own_at(const OwnRecord& own, double time_s) {
  const auto after = std::ranges::lower_bound(own.time_s, time_s);
  if (after == own.time_s.end()) return std::nullopt;
  const auto k = static_cast<std::size_t>(after - own.time_s.begin());
  const std::size_t before = k == 0 ? 0 : k - 1;
  const double step_s = own.time_s[k] - own.time_s[before];
  if (step_s > kLongestGapS || !std::isfinite(own.sd_m[k])) return std::nullopt;
  const double share = step_s > 0 ? (time_s - own.time_s[before]) / step_s : 1;
  return OwnAt{std::lerp(own.position_m[before], own.position_m[k], share), own.sd_m[k]};
}

Result<void> check_unit(const Given& inside, const OwnRecord& own) {
  std::vector<double> time_s, outside_m, own_m;
  for (std::size_t row = 0; row < inside.time_s.size(); ++row) {
    const auto at = own_at(own, inside.time_s[row]);
    if (!at) continue;
    time_s.push_back(inside.time_s[row]);
    outside_m.push_back(inside.position_m[row]);
    own_m.push_back(at->position_m);
  }
  if (time_s.size() < kFewestPositionsToImport) return {};
  return check_metres(time_s, std::move(outside_m), std::move(own_m));
}

// The mean of own less outside position, weighed by how sure the robot is; none where the two have no time in common.
Result<void> find_zero(const Given& inside, const OwnRecord& own, storage::OutsideReference& into) {
  double sum_m = 0, weights = 0, surest_m = std::numeric_limits<double>::infinity(), outside_variance_m2 = 0;
  std::size_t used = 0;
  for (std::size_t row = 0; row < inside.time_s.size(); ++row) {
    const auto at = own_at(own, inside.time_s[row]);
    if (!at) continue;
    const double own_sd_m = std::max(at->sd_m, kLeastOwnSdM), weight = 1 / (own_sd_m * own_sd_m);
    sum_m += weight * (at->position_m - inside.position_m[row]);
    weights += weight;
    surest_m = std::min(surest_m, at->sd_m);
    outside_variance_m2 += inside.sd_m[row] * inside.sd_m[row];
    ++used;
  }
  if (used < kFewestPositionsToImport) {
    return fail(ErrorCode::invalid,
                fmt::format("only {} positions fall on samples of the robot's own record, so the zero cannot be found; "
                            "keep the zero (--keep-zero) if it is the robot's",
                            used),
                "no_zero");
  }
  into.zero_offset_m = sum_m / weights;
  into.zero_sd_m = std::hypot(surest_m, std::sqrt(outside_variance_m2) / static_cast<double>(used));
  return {};
}

std::string plus_minus(std::optional<double> sd, double scale, const char* unit) {
  return sd ? fmt::format(" ± {:.2g} {} (2 sd)", 2 * scale * *sd, unit) : std::string{" (how exact is not known)"};
}

}  // namespace

OwnPosition own_position(const storage::StoredSample& stored) {
  return {stored.span,
          stored.robot_time_us,
          stored.utc_us,
          stored.clock_uncertainty_us,
          stored.sample.position_m - station::or_nan(stored.disturbance_m),
          station::or_nan(stored.position_sd_m)};
}

Result<PlacedReference> place_reference(const ReferenceRequest& request, std::span<const OwnPosition> samples,
                                        std::span<const storage::Zeroing> zeroings,
                                        std::optional<storage::MarkerPlace> marker) {
  const auto given = read_given(request);
  if (!given) return std::unexpected{given.error()};
  const auto own = own_record(samples, zeroings,
                              request.span ? request.span
                              : marker     ? std::optional{marker->span}
                                           : std::nullopt);
  if (!own) return std::unexpected{own.error()};
  PlacedReference placed;
  storage::OutsideReference& made = placed.reference;
  made.span = own->span;
  made.source = request.source;
  made.sha256 = runtime::sha256_of(request.csv);
  if (const auto found = find_clock(request, *given, *own, marker, made); !found) {
    return std::unexpected{found.error()};
  }
  const Given inside = rows_in_span(*given, *own, made.clock_offset_s);
  if (inside.time_s.size() < kFewestPositionsToImport) {
    return fail(
        ErrorCode::invalid,
        fmt::format("{} of {} rows lie in span {} of the run, from 0 to {:.3f} s, with a clock offset of {:.3f} "
                    "s; at least {} are needed",
                    inside.time_s.size(), given->time_s.size(), own->span, own->seconds(own->last_us),
                    made.clock_offset_s, kFewestPositionsToImport),
        "not_in_run");
  }
  if (!request.is_in_metres) {
    if (const auto metres = check_unit(inside, *own); !metres) return std::unexpected{metres.error()};
  }
  made.zero_is_kept = request.keeps_zero;
  if (!request.keeps_zero) {
    if (const auto found = find_zero(inside, *own, made); !found) return std::unexpected{found.error()};
  }
  for (std::size_t row = 0; row < inside.time_s.size(); ++row) {
    const std::uint64_t at_us = own->first_us + static_cast<std::uint64_t>(std::llround(1e6 * inside.time_s[row]));
    storage::OutsidePositions& positions = placed.positions;
    if (positions.size() > 0 && positions.robot_time_us.back() >= at_us) {
      return fail(ErrorCode::invalid, "two rows lie less than a microsecond apart", "malformed_csv");
    }
    positions.robot_time_us.push_back(at_us);
    positions.position_m.push_back(inside.position_m[row] + made.zero_offset_m);
    positions.position_sd_m.push_back(inside.sd_m[row]);
  }
  made.samples = placed.positions.size();
  made.samples_left_out = given->time_s.size() - made.samples;
  return placed;
}

std::string clock_in_words(const storage::OutsideReference& reference) {
  std::string how = fmt::format("clock by {}", text(reference.clock));
  if (reference.correlation) {
    how += fmt::format(" with the robot's own motion ({:.4f}; it moves {:.3f} times what that says)",
                       *reference.correlation, reference.motion_ratio.value_or(1));
  }
  return fmt::format("{}: its t_s plus {:.4f} s{} is the time since the first sample of span {}", how,
                     reference.clock_offset_s, plus_minus(reference.clock_sd_s, 1e3, "ms"), reference.span);
}

std::string zero_in_words(const storage::OutsideReference& reference) {
  if (reference.zero_is_kept) return "zero kept as it was given";
  return fmt::format("zero by the robot's own record: {:.4f} m{} were added to each position", reference.zero_offset_m,
                     plus_minus(reference.zero_sd_m, 1e3, "mm"));
}

nlohmann::json json_of(const storage::OutsideReference& reference) {
  nlohmann::json out;
  out["run_id"] = reference.run;
  out["span"] = reference.span;
  out["source"] = reference.source;
  out["sha256"] = reference.sha256;
  out["clock_method"] = text(reference.clock);
  out["clock_offset_s"] = reference.clock_offset_s;
  out["clock_sd_s"] = or_null(reference.clock_sd_s);
  out["correlation"] = or_null(reference.correlation);
  out["motion_ratio"] = or_null(reference.motion_ratio);
  out["zero_is_kept"] = reference.zero_is_kept;
  out["zero_offset_m"] = reference.zero_offset_m;
  out["zero_sd_m"] = or_null(reference.zero_sd_m);
  out["samples"] = reference.samples;
  out["samples_left_out"] = reference.samples_left_out;
  out["actor"] = reference.actor;
  out["made_at_us"] = reference.made_at_us;
  out["in_words"] = clock_in_words(reference) + "; " + zero_in_words(reference);
  return out;
}

}  // namespace server::analysis
