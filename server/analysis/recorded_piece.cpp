// Selects the samples of a window, and finds what is wrong between them.
#include "server/analysis/recorded_piece.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <utility>

#include "control/search/fit_statistics.hpp"
#include "control/search/missed_ticks.hpp"

namespace server::analysis {
namespace {

constexpr std::size_t kMostWindows = 3;  // in a message

// A fault between two neighbours, if there is one. Stored times are right to 100 us, so whole periods are asked for
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

}  // namespace

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

double usual_step_s(const Piece& piece) {
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < piece.samples.size(); ++i) {
    const storage::StoredSample &before = piece.samples[i - 1], &after = piece.samples[i];
    if (after.seq == before.seq + 1) steps_s.push_back(piece.seconds(after) - piece.seconds(before));
  }
  return control::median(std::move(steps_s));
}

std::vector<std::size_t> ticks_of(const Piece& piece, double dt_s) {
  std::vector<std::size_t> ticks{0};
  for (std::size_t i = 1; i < piece.samples.size(); ++i) {
    const double step_s = piece.seconds(piece.samples[i]) - piece.seconds(piece.samples[i - 1]);
    ticks.push_back(ticks.back() + static_cast<std::size_t>(std::max(1.0, std::round(step_s / dt_s))));
  }
  return ticks;
}

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

Cut::Cut(const Piece& piece, const RunWindow& window, double dt_s, Motion motion, double most_skipped) {
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

std::optional<RunWindow> Cut::longest(const Piece& piece, RunWindow window) const {
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

std::unexpected<Error> Cut::refusal(const Piece& piece) const {
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

// The piece's own beginning is the caller's choice.
bool Cut::begins_at_rest(const Piece& piece, const Part& part) {
  if (part.begin == 0) return true;
  const double begins_s = piece.seconds(piece.samples[part.begin]);
  return std::ranges::none_of(piece.samples | std::views::take(part.begin), [&](const storage::StoredSample& before) {
    return begins_s - piece.seconds(before) <= kTimeToRest_s && !(before.sample.duty == 0);
  });
}

void Cut::end_part(std::size_t end, std::size_t next_begin, std::string why) {
  if (end > begin_) parts_.push_back({begin_, end});
  begin_ = next_begin;
  faults_.push_back(std::move(why));
}

}  // namespace server::analysis
