// Takes what is fitted from a piece of a run, and refuses what is not equally spaced.
#include "server/analysis/run_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "control/search/fit_statistics.hpp"
#include "control/search/missed_ticks.hpp"
#include "control/sensor/position_weight.hpp"
#include "server/analysis/motion_at_start.hpp"
#include "server/analysis/recorded_piece.hpp"
#include "server/storage/samples/position_sd.hpp"

namespace server::analysis {
namespace {

constexpr std::size_t kFewestPositionsToFit = 20;  // from outside

double largest_position_sd_m(const Piece& piece) {
  double largest_m = 0;
  for (const storage::StoredSample& stored : piece.samples) {
    largest_m = storage::larger_sd_m(largest_m, static_cast<double>(station::or_nan(stored.position_sd_m)));
  }
  return largest_m;
}

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

bool is_interrupted(std::span<const storage::InterruptedPart> parts, std::uint32_t span, std::uint64_t robot_time_us) {
  return std::ranges::any_of(parts, [&](const storage::InterruptedPart& part) {
    return part.span == span && robot_time_us >= part.from_robot_us && robot_time_us < part.to_robot_us;
  });
}

OutsidePart outside_part(const Piece& piece, const RunSamples& run) {
  OutsidePart part;
  if (!run.reference) return part;
  const storage::StoredReference& stored = *run.reference;
  if (stored.reference.span != piece.samples.front().span) return part;
  const std::uint64_t first_us = piece.samples.front().robot_time_us, last_us = piece.samples.back().robot_time_us;
  for (std::size_t i = 0; i < stored.positions.size(); ++i) {
    const std::uint64_t at_us = stored.positions.robot_time_us[i];
    if (at_us < first_us || at_us >= last_us) continue;
    if (is_interrupted(run.interrupted, stored.reference.span, at_us)) continue;
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
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < time_s.size(); ++i) steps_s.push_back(time_s[i] - time_s[i - 1]);
  seen.dt_s = control::median(std::move(steps_s));  // what was left out between them does not move it
  seen.position_m = recording.position_m;
  for (const double at_s : time_s) {
    const auto tick = static_cast<std::size_t>(at_s / recording.dt_s);
    seen.duty.push_back(recording.duty[std::min(tick, recording.duty.size() - 1)]);
  }
  return seen;
}

// Ticks of the parts in which the experiment was interrupted; empty: none.
std::vector<bool> interrupted_ticks(const Piece& piece, const std::vector<std::size_t>& ticks, const RunSamples& run) {
  std::vector<bool> interrupted(ticks.back() + 1);
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    const storage::StoredSample& stored = piece.samples[k];
    interrupted[ticks[k]] = is_interrupted(run.interrupted, stored.span, stored.robot_time_us);
  }
  if (std::ranges::find(interrupted, true) == interrupted.end()) interrupted.clear();
  return interrupted;
}

std::string interrupted_in_words(const Piece& piece, const RunSamples& run, double interrupted_s) {
  std::string words = fmt::format(
      "the experiment was interrupted, {:.2f} s in all: the model is simulated through that with the duty of then, and "
      "the values are left out of the fit",
      interrupted_s);
  std::size_t named = 0;
  for (const storage::InterruptedPart& part : run.interrupted) {
    const bool is_of_piece = part.span == piece.samples.front().span &&
                             part.to_robot_us > piece.samples.front().robot_time_us &&
                             part.from_robot_us <= piece.samples.back().robot_time_us;
    if (!is_of_piece || ++named > kMostFaults) continue;
    const double from_s = static_cast<double>(part.from_robot_us - piece.span_began_us) / 1e6;
    words += fmt::format("{} from {:.2f} s for {:.2f} s ({})", named == 1 ? ":" : ",", from_s,
                         static_cast<double>(part.to_robot_us - part.from_robot_us) / 1e6, part.reason);
  }
  if (named > kMostFaults) words += fmt::format(", and {} more", named - kMostFaults);
  return words;
}

// Interruptions within the piece after which the experiment went on: all that it was to do is there beside them.
double gone_on_s(const Piece& piece, const RunSamples& run) {
  double all_s = 0;
  const std::uint64_t begins_us = piece.samples.front().robot_time_us;
  std::uint64_t driven_us = 0;  // last
  for (const storage::StoredSample& stored : piece.samples) {
    if (stored.sample.duty != 0) driven_us = stored.robot_time_us;
  }
  for (const storage::InterruptedPart& part : run.interrupted) {
    if (part.span != piece.samples.front().span || part.to_robot_us > driven_us || part.to_robot_us <= begins_us)
      continue;
    all_s += static_cast<double>(part.to_robot_us - std::max(part.from_robot_us, begins_us)) / 1e6;
  }
  return all_s;
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

namespace {

// Its values, one a sample, or of a position from outside as often as that was measured.
control::Recording values_of(const Piece& piece, const RunWindow& window, Motion motion, const OutsidePart& outside) {
  control::Recording recording;
  for (const storage::StoredSample& stored : piece.samples) {
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
  }
  return recording;
}

// A warning that the robot was not at rest at the beginning, as the model assumes; none: it was.
std::optional<std::string> under_way(const Piece& piece, Motion motion, const control::Recording& recording) {
  if (auto driven = driven_before(piece)) return driven;
  std::vector<double> recorded_m_s;
  for (const storage::StoredSample& stored : piece.samples) {
    recorded_m_s.push_back(static_cast<double>(stored.sample.velocity_m_s));
  }
  return motion_at_start(motion == Motion::outside ? as_seen(recording) : recording, recorded_m_s);
}

Result<RunRecording> recording_in(const RunSamples& run, const Piece& piece, const RunWindow& window,
                                  ChannelChoice choice) {
  const double dt_s = usual_step_s(piece);
  const double position_sd_m = largest_position_sd_m(piece);
  const OutsidePart outside = choice == ChannelChoice::robot ? OutsidePart{} : outside_part(piece, run);
  if (choice == ChannelChoice::outside && !outside.is_enough()) {
    return fail(ErrorCode::invalid, fmt::format("the window has {} positions from outside; at least {} are needed",
                                                outside.time_s.size(), kFewestPositionsToFit));
  }
  const Motion motion = outside.is_enough()                   ? Motion::outside
                        : storage::is_estimate(position_sd_m) ? Motion::acceleration
                                                              : Motion::position;
  const Cut cut{piece, window, dt_s, motion, control::most_missed_in_a_row(dt_s)};
  const auto recorded_from = [&](const RunWindow& part, const std::string& why) {
    const auto chosen = select(run.samples, part);
    if (!chosen) return Result<RunRecording>{std::unexpected{chosen.error()}};
    auto recorded = recording_in(run, *chosen, part, choice);
    if (recorded) recorded->warnings.push_back(fmt::format("{}, from {:.3f} to {:.3f} s", why, part.from_s, part.to_s));
    return recorded;
  };
  if (!cut.is_whole()) {
    const auto part = window.cuts_at_gaps ? cut.longest(piece, window) : std::nullopt;
    if (!part) return cut.refusal(piece);
    return recorded_from(*part, "the recording has gaps: fitted is its longest part without one that begins at rest");
  }
  const std::vector<std::size_t> ticks = ticks_of(piece, dt_s);
  const std::size_t all = ticks.back() + 1, left_out = all - ticks.size();
  if (!control::may_be_missed(left_out, all)) {
    const std::string skipped = fmt::format("the robot skipped {} of {} periods, more than {:g} %", left_out, all,
                                            100 * control::kMostMissedShare);
    const auto part = with_few_missed(piece, ticks, window);
    if (!part) return fail(ErrorCode::invalid, skipped + "; no part of it is long enough", "gap");
    if (window.cuts_at_gaps) {
      return recorded_from(*part, skipped + ": fitted is the longest part with fewer that begins at rest");
    }
    return fail(ErrorCode::invalid, fmt::format("{}; choose --from-s {} --to-s {}", skipped, part->from_s, part->to_s),
                "gap");
  }
  RunRecording made{values_of(piece, window, motion, outside), channels_reason(position_sd_m), {}};
  control::Recording& recording = made.recording;
  recording.dt_s = piece.length_s() / static_cast<double>(ticks.back());
  if (motion == Motion::outside) {
    made.channels_reason = outside.in_words(*run.reference);
    made.position_sd_m = control::sd_of_mean_weight(outside.sd_m);
  }
  control::place_at_ticks(recording, ticks);
  recording.is_left_out = interrupted_ticks(piece, ticks, run);
  if (!recording.is_left_out.empty()) {
    const auto interrupted = static_cast<double>(std::ranges::count(recording.is_left_out, true));
    made.warnings.push_back(interrupted_in_words(piece, run, recording.dt_s * interrupted));
  }
  if (const std::string missed = control::missed_ticks_in_words(recording); !missed.empty()) {
    made.warnings.push_back(missed);
  }
  if (const auto warning = under_way(piece, motion, recording)) made.warnings.push_back(*warning);
  return made;
}

}  // namespace

Result<RunRecording> recording_of(const RunSamples& run, const RunWindow& window, ChannelChoice choice) {
  const auto piece = select(run.samples, window);
  if (!piece) return std::unexpected{piece.error()};
  auto made = recording_in(run, *piece, window, choice);
  if (!made) return made;
  const double asked_s = piece->length_s() - gone_on_s(*piece, run);
  const std::vector<bool> uncounted = control::uncounted_ticks(made->recording);
  const auto counted = static_cast<double>(std::ssize(made->recording.duty) - std::ranges::count(uncounted, true));
  if (made->recording.dt_s * counted >= kFewestUsable * asked_s) return made;
  return fail(
      ErrorCode::invalid,
      fmt::format("of the {:.1f} s that were asked for only {:.1f} s can be fitted, less than {:g} %: {}. Repeat "
                  "the run, or choose a part of it with --from-s and --to-s",
                  asked_s, made->recording.dt_s * counted, 100 * kFewestUsable, fmt::join(made->warnings, "; ")),
      "too_little_usable");
}

}  // namespace server::analysis
