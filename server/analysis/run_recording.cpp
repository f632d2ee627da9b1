// Selects a window of a run and refuses what is not equally spaced.
#include "server/analysis/run_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <utility>

#include "control/search/missed_ticks.hpp"
#include "control/sensor/position_weight.hpp"
#include "server/analysis/motion_at_start.hpp"
#include "server/storage/samples/position_sd.hpp"

namespace server::analysis {
namespace {

constexpr std::size_t kFewestSamples = 10;
constexpr std::size_t kMostFaults = 5, kMostWindows = 3;  // in a message
constexpr double kTimeToRest_s = 5;
constexpr std::size_t kFewestPositionsToFit = 20;  // from outside

struct Piece {
  std::uint64_t span_began_us = 0;
  std::vector<storage::StoredSample> samples;
  std::optional<double> driven_at_s;  // the last duty before them, if it is not long ago

  double seconds(const storage::StoredSample& stored) const {
    return static_cast<double>(stored.robot_time_us - span_began_us) / 1e6;
  }
};

Result<Piece> select(std::span<const storage::StoredSample> samples, const RunWindow& window) {
  if (samples.empty()) return fail(ErrorCode::invalid, "the run has no samples");
  if (!window.span && samples.front().span != samples.back().span) {
    return fail(ErrorCode::invalid,
                fmt::format("the robot rebooted during the run, which has spans {} to {}; choose one with --span",
                            samples.front().span, samples.back().span));
  }
  const std::uint32_t span = window.span.value_or(samples.front().span);
  Piece piece;
  bool has_begun = false;
  for (const storage::StoredSample& stored : samples) {
    if (stored.span != span) continue;
    if (!has_begun) piece.span_began_us = stored.robot_time_us;
    has_begun = true;
    const double at_s = piece.seconds(stored);
    if (at_s < window.from_s && std::abs(stored.sample.duty) > 0) piece.driven_at_s = at_s;
    if (at_s >= window.from_s && at_s <= window.to_s) piece.samples.push_back(stored);
  }
  if (piece.samples.size() < kFewestSamples) {
    return fail(ErrorCode::invalid, fmt::format("span {} has {} samples from {} to {} s; at least {} are needed", span,
                                                piece.samples.size(), window.from_s, window.to_s, kFewestSamples));
  }
  if (piece.driven_at_s && piece.seconds(piece.samples.front()) - *piece.driven_at_s > kTimeToRest_s) {
    piece.driven_at_s.reset();
  }
  return piece;
}

// The middle one of the steps between samples that follow each other: what gaps cannot move.
double usual_step_s(const Piece& piece) {
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < piece.samples.size(); ++i) {
    const storage::StoredSample &before = piece.samples[i - 1], &after = piece.samples[i];
    if (after.seq == before.seq + 1) steps_s.push_back(piece.seconds(after) - piece.seconds(before));
  }
  if (steps_s.empty()) return 0;
  const auto middle = steps_s.begin() + static_cast<std::ptrdiff_t>(steps_s.size() / 2);
  std::ranges::nth_element(steps_s, middle);
  return *middle;
}

// What is wrong between two neighbours, if anything. Stored times are right to 100 us, so whole periods are asked for
// within a tenth of one. A few that the robot skipped are missed ticks, and no fault.
std::optional<std::string> gap_between(const Piece& piece, const storage::StoredSample& before,
                                       const storage::StoredSample& after, double dt_s, double most_skipped) {
  const double at_s = piece.seconds(before), step_s = piece.seconds(after) - at_s;
  if (after.seq != before.seq + 1) {
    return fmt::format("a gap of {:.3f} s at {:.3f} s ({} samples after seq {} are not there)", step_s, at_s,
                       after.seq - before.seq - 1, before.seq);
  }
  if (std::abs(step_s - dt_s) <= 0.1 * dt_s) return std::nullopt;
  const double skipped = std::round(step_s / dt_s) - 1;
  if (skipped >= 1 && skipped <= most_skipped && std::abs(step_s - (skipped + 1) * dt_s) <= 0.1 * dt_s) {
    return std::nullopt;
  }
  if (!(skipped >= 1)) return fmt::format("a step of {:.4g} s, not {:.4g} s, at {:.3f} s", step_s, dt_s, at_s);
  return fmt::format("the robot skipped {} {} at {:.3f} s; no sample was lost", skipped,
                     skipped == 1 ? "period" : "periods", at_s);
}

// The tick of each sample.
std::vector<std::size_t> ticks_of(const Piece& piece, double dt_s) {
  std::vector<std::size_t> ticks{0};
  for (std::size_t i = 1; i < piece.samples.size(); ++i) {
    const double step_s = piece.seconds(piece.samples[i]) - piece.seconds(piece.samples[i - 1]);
    ticks.push_back(ticks.back() + static_cast<std::size_t>(std::max(1.0, std::round(step_s / dt_s))));
  }
  return ticks;
}

// The longest window from rest of whose ticks few enough are missing; none: each is too short.
std::optional<RunWindow> with_few_missed(const Piece& piece, std::span<const std::size_t> ticks, RunWindow window) {
  constexpr double kShare = control::kMostMissedShare, kRounding = 1e-6;
  std::vector<double> excess(ticks.size());  // from i to j too many are missing if it grows by more than kShare
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    excess[k] = (1 - kShare) * static_cast<double>(ticks[k]) - static_cast<double>(k);
  }
  std::vector<double> least = excess;  // from here on
  for (std::size_t k = least.size() - 1; k > 0; --k) least[k - 1] = std::min(least[k - 1], least[k]);
  std::size_t begin = 0, size = 0;
  double driven_at_s = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double at_s = piece.seconds(piece.samples[i]);
    const auto after = std::ranges::upper_bound(least, excess[i] + kShare - kRounding) - least.begin();
    const std::size_t reached = static_cast<std::size_t>(after) - i;
    if ((i == 0 || at_s - driven_at_s > kTimeToRest_s) && reached > size) {
      begin = i;
      size = reached;
    }
    if (!(piece.samples[i].sample.duty == 0)) driven_at_s = at_s;
  }
  if (size < kFewestSamples) return std::nullopt;
  window.span = piece.samples[begin].span;
  window.from_s = piece.seconds(piece.samples[begin]);
  window.to_s = piece.seconds(piece.samples[begin + size - 1]);
  window.cuts_at_gaps = false;
  return window;
}

double largest_position_sd_m(const Piece& piece) {
  double largest_m = 0;
  for (const storage::StoredSample& stored : piece.samples) {
    largest_m = storage::larger_sd_m(largest_m, static_cast<double>(station::or_nan(stored.position_sd_m)));
  }
  return largest_m;
}

// Where the motion of the piece is had from.
enum class Motion : std::uint8_t { outside, acceleration, position };

std::optional<std::string> missing_in(const Piece& piece, const storage::StoredSample& stored, const RunWindow& window,
                                      Motion motion) {
  const station::Sample& sample = stored.sample;
  if (motion == Motion::outside) {
    if (std::isfinite(sample.duty)) return std::nullopt;
    return fmt::format("sample seq {} at {:.3f} s lacks its duty", stored.seq, piece.seconds(stored));
  }
  if (motion == Motion::acceleration) {
    if (std::isfinite(sample.duty) && std::isfinite(sample.acceleration_m_s2)) return std::nullopt;
    return fmt::format("sample seq {} at {:.3f} s lacks a value (duty {}, acceleration_m_s2 {})", stored.seq,
                       piece.seconds(stored), sample.duty, sample.acceleration_m_s2);
  }
  const bool is_whole = std::isfinite(sample.position_m) && stored.disturbance_m && std::isfinite(sample.duty) &&
                        (!window.with_velocity || std::isfinite(sample.velocity_m_s));
  if (is_whole) return std::nullopt;
  return fmt::format("sample seq {} at {:.3f} s lacks a value (duty {}, position_m {}, velocity_m_s {})", stored.seq,
                     piece.seconds(stored), sample.duty, sample.position_m, sample.velocity_m_s);
}

// Cuts the piece where it is not whole.
class Cut {
 public:
  Cut(const Piece& piece, const RunWindow& window, double dt_s, Motion motion, double most_skipped) {
    for (std::size_t i = 0; i < piece.samples.size(); ++i) {
      const storage::StoredSample& stored = piece.samples[i];
      if (i > 0) {
        if (const auto gap = gap_between(piece, piece.samples[i - 1], stored, dt_s, most_skipped)) end_part(i, i, *gap);
      }
      if (const auto missing = missing_in(piece, stored, window, motion)) end_part(i, i + 1, *missing);
    }
    end_part(piece.samples.size(), 0, "");
    faults_.pop_back();
  }

  bool is_whole() const { return faults_.empty(); }

  // The longest window without a fault that begins at rest, as the model assumes; none: each is too short.
  std::optional<RunWindow> longest(const Piece& piece, RunWindow window) const {
    Part part;
    for (const Part& one : parts_) {
      if (one.size() > part.size() && begins_at_rest(piece, one)) part = one;
    }
    if (part.size() < kFewestSamples) return std::nullopt;
    window.span = piece.samples[part.begin].span;
    window.from_s = piece.seconds(piece.samples[part.begin]);
    window.to_s = piece.seconds(piece.samples[part.end - 1]);
    return window;
  }

  // Every fault, up to a few, and the longest windows that have none.
  std::unexpected<Error> refusal(const Piece& piece) const {
    std::string detail = fmt::format("not a whole recording: {}",
                                     fmt::join(std::span{faults_}.first(std::min(faults_.size(), kMostFaults)), "; "));
    if (faults_.size() > kMostFaults) detail += fmt::format("; and {} more", faults_.size() - kMostFaults);
    std::vector<Part> longest = parts_;
    std::erase_if(longest, [](const Part& part) { return part.size() < kFewestSamples; });
    std::ranges::sort(longest, {}, [](const Part& part) { return std::pair(~part.size(), part.begin); });
    longest.resize(std::min(longest.size(), kMostWindows));
    if (longest.empty()) return fail(ErrorCode::invalid, detail + "; no part of it is long enough", "gap");
    std::vector<std::string> windows;
    windows.reserve(longest.size());
    for (const Part& part : longest) {
      windows.push_back(fmt::format("--from-s {} --to-s {}", piece.seconds(piece.samples[part.begin]),
                                    piece.seconds(piece.samples[part.end - 1])));
    }
    return fail(ErrorCode::invalid, fmt::format("{}; choose {}", detail, fmt::join(windows, ", or ")), "gap");
  }

 private:
  struct Part {
    std::size_t begin = 0, end = 0;
    std::size_t size() const { return end - begin; }
  };

  // The piece's own beginning is the caller's choice.
  static bool begins_at_rest(const Piece& piece, const Part& part) {
    if (part.begin == 0) return true;
    const double begins_s = piece.seconds(piece.samples[part.begin]);
    return std::ranges::none_of(piece.samples | std::views::take(part.begin), [&](const storage::StoredSample& before) {
      return begins_s - piece.seconds(before) <= kTimeToRest_s && !(before.sample.duty == 0);
    });
  }

  void end_part(std::size_t end, std::size_t next_begin, std::string why) {
    if (end > begin_) parts_.push_back({begin_, end});
    begin_ = next_begin;
    faults_.push_back(std::move(why));
  }

  std::size_t begin_ = 0;
  std::vector<Part> parts_;
  std::vector<std::string> faults_;
};

// What of a reference lies in a piece, in seconds since its first sample.
struct OutsidePart {
  std::vector<double> time_s, position_m, sd_m;

  bool is_enough() const { return time_s.size() >= kFewestPositionsToFit; }
  std::string in_words(const storage::StoredReference& from) const {
    const storage::OutsideReference& reference = from.reference;
    const double rate_hz = static_cast<double>(time_s.size() - 1) / (time_s.back() - time_s.front());
    const std::string clock_sd =
        reference.clock_sd_s ? fmt::format(" ± {:.2g} ms", 2e3 * *reference.clock_sd_s) : std::string{};
    return fmt::format(
        "position measured from outside ({}), {:.3g} Hz, {}, clock by {}{}: fitted at its own times, with zero "
        "and what is left of the clock's error as further unknowns; the robot's own record gives the duty only",
        reference.source, rate_hz, exactness(), text(reference.clock), clock_sd);
  }
  std::string exactness() const {
    const auto [least_m, most_m] = std::ranges::minmax(sd_m);
    if (least_m == most_m) return fmt::format("± {:.2g} mm", 2e3 * most_m);
    return fmt::format("± {:.2g} to {:.2g} mm (each weighs by its own)", 2e3 * least_m, 2e3 * most_m);
  }
};

OutsidePart outside_part(const Piece& piece, const storage::StoredReference& stored) {
  OutsidePart part;
  if (stored.reference.span != piece.samples.front().span) return part;
  const std::uint64_t first_us = piece.samples.front().robot_time_us, last_us = piece.samples.back().robot_time_us;
  for (std::size_t i = 0; i < stored.positions.size(); ++i) {
    const std::uint64_t at_us = stored.positions.robot_time_us[i];
    if (at_us < first_us || at_us >= last_us) continue;
    part.time_s.push_back(static_cast<double>(at_us - first_us) * 1e-6);
    part.position_m.push_back(stored.positions.position_m[i]);
    part.sd_m.push_back(stored.positions.position_sd_m[i]);
  }
  return part;
}

// As if the samples had been made when the positions were measured: to look at how it begins.
control::Recording as_seen(const control::Recording& recording) {
  control::Recording seen;
  const std::vector<double>& time_s = recording.position_time_s;
  seen.dt_s = (time_s.back() - time_s.front()) / static_cast<double>(time_s.size() - 1);
  seen.position_m = recording.position_m;
  for (const double at_s : time_s) {
    const auto tick = static_cast<std::size_t>(at_s / recording.dt_s);
    seen.duty.push_back(recording.duty[std::min(tick, recording.duty.size() - 1)]);
  }
  return seen;
}

std::optional<std::string> driven_before(const Piece& piece) {
  if (!piece.driven_at_s) return std::nullopt;
  const double begins_s = piece.seconds(piece.samples.front());
  return fmt::format(
      "the window begins at {:.3f} s, {:.3f} s after the run's duty was last not 0; the model assumes rest before the "
      "first sample, so its parameters may be wrong: begin the window at rest, {:g} s after the last duty",
      begins_s, begins_s - *piece.driven_at_s, kTimeToRest_s);
}

}  // namespace

std::string position_sd_in_words(double largest_position_sd_m) {
  if (std::isnan(largest_position_sd_m)) return "position_sd_m is not known";
  if (!storage::is_estimate(largest_position_sd_m)) return "position_sd_m is 0 throughout";
  return fmt::format("position_sd_m is up to {:.2g} m", largest_position_sd_m);
}

std::string channels_reason(double largest_position_sd_m) {
  const std::string sd = position_sd_in_words(largest_position_sd_m);
  if (!storage::is_estimate(largest_position_sd_m)) return "the position is known: " + sd;
  return fmt::format(
      "position_m and velocity_m_s are the robot's own estimates ({}) and contain the model that is built into it, so "
      "the acceleration is fitted, with bias, lag and clock of the sensor as further unknowns",
      sd);
}

const char* text(ChannelChoice value) {
  switch (value) {
    case ChannelChoice::best: return "best";
    case ChannelChoice::outside: return "outside";
    case ChannelChoice::robot: return "robot";
  }
  return "";
}

Result<RunRecording> recording_of(std::span<const storage::StoredSample> samples, const RunWindow& window,
                                  const storage::StoredReference* reference, ChannelChoice choice) {
  const auto piece = select(samples, window);
  if (!piece) return std::unexpected{piece.error()};
  const auto& chosen = piece->samples;
  const double dt_s = usual_step_s(*piece);
  const double position_sd_m = largest_position_sd_m(*piece);
  const OutsidePart outside =
      choice == ChannelChoice::robot || reference == nullptr ? OutsidePart{} : outside_part(*piece, *reference);
  if (choice == ChannelChoice::outside && !outside.is_enough()) {
    return fail(ErrorCode::invalid, fmt::format("the window has {} positions from outside; at least {} are needed",
                                                outside.time_s.size(), kFewestPositionsToFit));
  }
  const Motion motion = outside.is_enough()                   ? Motion::outside
                        : storage::is_estimate(position_sd_m) ? Motion::acceleration
                                                              : Motion::position;
  const Cut cut{*piece, window, dt_s, motion, control::most_missed_in_a_row(dt_s)};
  const auto recorded_from = [&](const RunWindow& part, const std::string& why) {
    auto recorded = recording_of(samples, part, reference, choice);
    if (recorded) recorded->warnings.push_back(fmt::format("{}, from {:.3f} to {:.3f} s", why, part.from_s, part.to_s));
    return recorded;
  };
  if (!cut.is_whole()) {
    const auto part = window.cuts_at_gaps ? cut.longest(*piece, window) : std::nullopt;
    if (!part) return cut.refusal(*piece);
    return recorded_from(*part, "the recording has gaps: fitted is its longest part without one that begins at rest");
  }
  const std::vector<std::size_t> ticks = ticks_of(*piece, dt_s);
  const std::size_t all = ticks.back() + 1, left_out = all - ticks.size();
  if (!control::may_be_missed(left_out, all)) {
    const std::string skipped = fmt::format("the robot skipped {} of {} periods, more than {:g} %", left_out, all,
                                            100 * control::kMostMissedShare);
    const auto part = with_few_missed(*piece, ticks, window);
    if (!part) return fail(ErrorCode::invalid, skipped + "; no part of it is long enough", "gap");
    if (window.cuts_at_gaps) {
      return recorded_from(*part, skipped + ": fitted is the longest part with fewer that begins at rest");
    }
    return fail(ErrorCode::invalid, fmt::format("{}; choose --from-s {} --to-s {}", skipped, part->from_s, part->to_s),
                "gap");
  }
  RunRecording made{{}, channels_reason(position_sd_m), {}};
  control::Recording& recording = made.recording;
  recording.dt_s = (piece->seconds(chosen.back()) - piece->seconds(chosen.front())) / static_cast<double>(ticks.back());
  std::vector<double> recorded_m_s;
  for (const storage::StoredSample& stored : chosen) {
    recorded_m_s.push_back(static_cast<double>(stored.sample.velocity_m_s));
    recording.duty.push_back(static_cast<double>(stored.sample.duty));
    if (motion == Motion::outside) continue;
    if (motion == Motion::acceleration) {
      recording.acceleration_m_s2.push_back(static_cast<double>(stored.sample.acceleration_m_s2));
      continue;
    }
    recording.position_m.push_back(static_cast<double>(stored.sample.position_m) -
                                   static_cast<double>(station::or_nan(stored.disturbance_m)));
    if (window.with_velocity) recording.velocity_m_s.push_back(static_cast<double>(stored.sample.velocity_m_s));
  }
  if (motion == Motion::outside) {
    recording.position_time_s = outside.time_s;
    recording.position_m = outside.position_m;
    recording.position_sd_m = outside.sd_m;
    made.channels_reason = outside.in_words(*reference);
    made.position_sd_m = control::sd_of_mean_weight(outside.sd_m);
  }
  control::place_at_ticks(recording, ticks);
  if (const std::string missed = control::missed_ticks_in_words(recording); !missed.empty()) {
    made.warnings.push_back(missed);
  }
  if (const auto warning = driven_before(*piece)) {
    made.warnings.push_back(*warning);
  } else if (const auto moves =
                 motion_at_start(motion == Motion::outside ? as_seen(recording) : recording, recorded_m_s)) {
    made.warnings.push_back(*moves);
  }
  return made;
}

}  // namespace server::analysis
