// Aligns a position measured from outside with the clock and the zero of a recorded run.
//
// The text is CSV with the columns t_s (ascending), position_m and, if it has one, position_sd_m. The clock is given by
// an offset, by the UTC of t_s = 0, by the time that a marker of the run has in the text, or found by correlation with
// the robot's own motion (control/sensor/clock_alignment). Where the zero is not kept it is the one with which the
// outside position agrees with the robot's own, each weighed by 1/position_sd_m²: the robot's own record decides where
// zero is, above all while it is sure of its position, and an error that it has from the first sample on stays unseen.
// Rows before or after the span are left out and counted. Pure and slow for long runs: call it on a worker.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/sensor/clock_alignment.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/runs/outside_reference.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::analysis {

inline constexpr std::size_t kMaxReferenceRows = 1'000'000;
inline constexpr std::size_t kMaxReferenceBytes = 16 * 1024 * 1024;  // of a request

struct ReferenceClockRequest {
  storage::ReferenceClock method = storage::ReferenceClock::correlation;
  double offset_s = 0;          // offset: time in the text, plus this = seconds since the first sample of the span
  std::int64_t zero_at_us = 0;  // utc: of t_s = 0
  std::optional<std::int64_t> marker_id;  // marker: this one or, without it, the only one with the text
  std::string marker_text;
  double at_s = 0;              // marker: its time in the text
  std::optional<double> sd_s;   // of the clock, as far as the asker knows; correlation finds its own
  control::OffsetRange search;  // correlation
};

struct ReferenceRequest {
  std::string csv;
  std::string source;  // a name
  ReferenceClockRequest clock;
  std::optional<std::uint32_t> span;  // none: the run's only one
  bool keeps_zero = false;
  bool is_in_metres = false;   // whatever its positions look like
  std::optional<double> sd_m;  // of every position, where the text has no column position_sd_m
  std::string reason;          // to replace another one
};

// What of a stored sample matters here.
struct OwnPosition {
  std::uint32_t span = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_us = 0;
  std::int64_t clock_uncertainty_us = -1;
  float position_m = 0;     // where the robot believes it is: without the disturbance
  float position_sd_m = 0;  // 0: it knows
};
OwnPosition own_position(const storage::StoredSample& stored);

struct PlacedReference {
  storage::OutsideReference reference;  // without run, author and time
  storage::OutsidePositions positions;
};

// `marker` belongs to the method of that name; `zeroings` are those of the run's boots. invalid: what cannot be used,
// with the line of the text, or why the clock cannot be found and what to do, or that positions over 2 m are not in
// metres by the robot's own record.
Result<PlacedReference> place_reference(const ReferenceRequest& request, std::span<const OwnPosition> own,
                                        std::span<const storage::Zeroing> zeroings,
                                        std::optional<storage::MarkerPlace> marker);

// What was done, in words: "clock by correlation (0.998) with the robot's own motion: ...".
std::string clock_in_words(const storage::OutsideReference& reference);
std::string zero_in_words(const storage::OutsideReference& reference);

// As the API and the command line answer it.
nlohmann::json json_of(const storage::OutsideReference& reference);

}  // namespace server::analysis
