// Correlates motions on a grid by FFT, then fits the offset at the measured times.
#include "control/sensor/clock_alignment.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

constexpr double kWindowS = 0.5;  // w
constexpr double kGridS = 0.02;   // of (2)
constexpr double kLongestGapS = 0.25;
constexpr double kLongestRecordS = 5 * 3600;
constexpr double kLeastMotionM = 0.005;  // within w: less says nothing of the clock
constexpr double kLeastOverlap = 0.5;    // of the motion of one of the two
constexpr double kLeastCorrelation = 0.8;
constexpr double kMainLobe = 4, kRival = 2;  // times the share of the motion that the best offset leaves unexplained
constexpr double kMainLobeFloor = 0.05, kRivalFloor = 0.01;
constexpr double kWidestPlateauS = 2;
constexpr double kBlockS = 2;  // of (4)
constexpr double kFewestBlocks = 8;
constexpr double kLeastSdS = 1e-4;  // recorded times are right to this
constexpr int kIterations = 30;

void check(const PositionRecord& record, const char* name) {
  if (record.time_s.size() != record.position_m.size()) {
    base::throw_invalid("clock alignment: ", name, " has ", record.time_s.size(), " times and ",
                        record.position_m.size(), " positions");
  }
  for (std::size_t k = 1; k < record.time_s.size(); ++k) {
    if (!(record.time_s[k] > record.time_s[k - 1])) {
      base::throw_invalid("clock alignment: the times of ", name, " must ascend, [", k, "] is ", record.time_s[k]);
    }
  }
}

// A record between its samples. `at` ascends from call to call, but for a window's length.
class Between {
 public:
  explicit Between(const PositionRecord& record) : record_(record) {}

  std::optional<double> position(double at_s) const {
    const std::optional<std::size_t> k = place(at_s);
    if (!k) return std::nullopt;
    return std::lerp(record_.position_m[*k], record_.position_m[*k + 1], share(*k, at_s));
  }

  // Of the straight line through the samples that surround the time.
  std::optional<double> velocity(double at_s) const {
    const std::optional<std::size_t> k = place(at_s);
    if (!k) return std::nullopt;
    const std::size_t before = *k == 0 ? 0 : *k - 1, after = std::min(*k + 2, record_.time_s.size() - 1);
    return (record_.position_m[after] - record_.position_m[before]) / (record_.time_s[after] - record_.time_s[before]);
  }

 private:
  // The sample before; none outside the record and in a gap.
  std::optional<std::size_t> place(double at_s) const {
    const auto after = std::ranges::upper_bound(record_.time_s, at_s);
    if (after == record_.time_s.begin() || after == record_.time_s.end()) return std::nullopt;
    const auto k = static_cast<std::size_t>(after - record_.time_s.begin()) - 1;
    if (record_.time_s[k + 1] - record_.time_s[k] > kLongestGapS) return std::nullopt;
    return k;
  }
  double share(std::size_t k, double at_s) const {
    return (at_s - record_.time_s[k]) / (record_.time_s[k + 1] - record_.time_s[k]);
  }

  PositionRecord record_;
};

// (1) on the grid; 0 where it is not known.
struct Motion {
  double from_s = 0;
  std::vector<double> step_m, is_known;

  double energy() const {
    double sum = 0;
    for (const double step : step_m) sum += step * step;
    return sum;
  }
  double largest_m() const {
    double largest = 0;
    for (const double step : step_m) largest = std::max(largest, std::abs(step));
    return largest;
  }
};

Motion motion_of(const PositionRecord& record) {
  const Between between{record};
  Motion motion;
  motion.from_s = record.time_s.front();
  const auto places = static_cast<std::size_t>((record.time_s.back() - motion.from_s) / kGridS) + 1;
  for (std::size_t i = 0; i < places; ++i) {
    const double at_s = motion.from_s + kGridS * static_cast<double>(i);
    const auto before = between.position(at_s - kWindowS / 2), after = between.position(at_s + kWindowS / 2);
    const bool is_known = before && after;
    motion.step_m.push_back(is_known ? *after - *before : 0);
    motion.is_known.push_back(is_known ? 1 : 0);
  }
  return motion;
}

// Σ_i a[i] b[i + k] for k = -(a.size() - 1) to b.size() - 1, in this order.
class Correlator {
 public:
  Correlator(std::size_t of_a, std::size_t of_b) : of_a_(of_a), of_b_(of_b) {
    while (length_ < of_a + of_b) length_ *= 2;
  }

  std::vector<double> operator()(const std::vector<double>& a, const std::vector<double>& b) {
    std::vector<std::complex<double>> of_a = spectrum(a), of_b = spectrum(b);
    for (std::size_t i = 0; i < length_; ++i) of_b[i] *= std::conj(of_a[i]);
    std::vector<std::complex<double>> turned;
    fft_.inv(turned, of_b);
    std::vector<double> sums;
    for (std::size_t i = 0; i + 1 < of_a_ + of_b_; ++i) {
      sums.push_back(turned[(i + length_ - (of_a_ - 1)) % length_].real());
    }
    return sums;
  }

 private:
  std::vector<std::complex<double>> spectrum(const std::vector<double>& values) {
    std::vector<std::complex<double>> padded(length_), result;
    std::ranges::copy(values, padded.begin());
    fft_.fwd(result, padded);
    return result;
  }

  std::size_t of_a_, of_b_, length_ = 1;
  Eigen::FFT<double> fft_;
};

std::vector<double> squares(std::vector<double> values) {
  for (double& value : values) value *= value;
  return values;
}

// (2) over all offsets, 0 where too little overlaps or the range ends.
struct Correlogram {
  double from_s = 0;  // the first offset
  std::vector<double> rho;

  double offset_s(std::size_t k) const { return from_s + kGridS * static_cast<double>(k); }
};

Correlogram correlogram(const Motion& outside, const Motion& own, OffsetRange range) {
  Correlator correlate{outside.step_m.size(), own.step_m.size()};
  const std::vector<double> common = correlate(outside.step_m, own.step_m);
  const std::vector<double> of_own = correlate(outside.is_known, squares(own.step_m));
  const std::vector<double> of_outside = correlate(squares(outside.step_m), own.is_known);
  const double all_outside = outside.energy(), all_own = own.energy();
  Correlogram result{own.from_s - outside.from_s - kGridS * static_cast<double>(outside.step_m.size() - 1), {}};
  for (std::size_t k = 0; k < common.size(); ++k) {
    const double offset_s = result.offset_s(k);
    const double overlap = std::max(of_outside[k] / all_outside, of_own[k] / all_own);
    const double product = of_outside[k] * of_own[k];
    const bool counts = overlap >= kLeastOverlap && product > 1e-6 * all_outside * all_own &&
                        offset_s >= range.from_s && offset_s <= range.to_s;
    result.rho.push_back(counts ? common[k] / std::sqrt(product) : 0);
  }
  return result;
}

double unexplained(double rho) { return rho > 0 ? 1 - rho * rho : 1; }

// Another offset that explains the motion nearly as well, outside the hill on which the best one stands.
std::optional<std::size_t> rival_of(const Correlogram& found, std::size_t best) {
  const double left = unexplained(found.rho[best]);
  const auto is_of_hill = [&](std::size_t k) { return unexplained(found.rho[k]) < kMainLobe * left + kMainLobeFloor; };
  std::size_t low = best, high = best;
  while (low > 0 && is_of_hill(low)) --low;
  while (high + 1 < found.rho.size() && is_of_hill(high)) ++high;
  std::optional<std::size_t> rival;
  for (std::size_t k = 0; k < found.rho.size(); ++k) {
    if (k >= low && k <= high) continue;
    if (!rival || found.rho[k] > found.rho[*rival]) rival = k;
  }
  if (rival && unexplained(found.rho[*rival]) < kRival * left + kRivalFloor) return rival;
  return std::nullopt;
}

// How far from end to end the offsets around the best one lie that explain the motion nearly as well as it does.
double plateau_s(const Correlogram& found, std::size_t best) {
  const double most = kRival * unexplained(found.rho[best]) + kRivalFloor;
  std::size_t low = best, high = best;
  while (low > 0 && unexplained(found.rho[low - 1]) < most) --low;
  while (high + 1 < found.rho.size() && unexplained(found.rho[high + 1]) < most) ++high;
  return kGridS * static_cast<double>(high - low);
}

// The pairs of (3): each time with the first one at least a window later, unless that is far later.
struct Pair {
  double from_s = 0, to_s = 0, step_m = 0;
};

std::vector<Pair> pairs_of(const PositionRecord& record) {
  std::vector<Pair> pairs;
  std::size_t later = 0;
  for (std::size_t j = 0; j < record.time_s.size(); ++j) {
    while (later < record.time_s.size() && record.time_s[later] < record.time_s[j] + kWindowS) ++later;
    if (later == record.time_s.size()) break;
    if (record.time_s[later] - record.time_s[j] > kWindowS + kLongestGapS) continue;
    pairs.push_back({record.time_s[j], record.time_s[later], record.position_m[later] - record.position_m[j]});
  }
  return pairs;
}

// (3) and (4).
class OffsetFit {
 public:
  OffsetFit(const PositionRecord& outside, const PositionRecord& own) : pairs_(pairs_of(outside)), own_(own) {}

  // False when it does not converge near its start.
  bool run(double start_s) {
    offset_s = start_s;
    for (int i = 0; i < kIterations; ++i) {
      const Eigen::Vector2d step = linearise();
      if (!step.allFinite()) return false;
      offset_s += std::clamp(step[0], -kGridS, kGridS);
      ratio += step[1];
      if (std::abs(offset_s - start_s) > kWindowS) return false;
      if (std::abs(step[0]) < 1e-9) break;
    }
    linearise();
    return B_.allFinite() && B_.determinant() > 0;
  }

  double offset_sd_s() const {
    const Eigen::Matrix2d inverse = B_.inverse();
    return std::max(kLeastSdS, std::sqrt((inverse * scores_ * inverse)(0, 0)));
  }

  double offset_s = 0, ratio = 1;

 private:
  Eigen::Vector2d linearise() {
    B_.setZero();
    scores_.setZero();
    const double record_s = pairs_.empty() ? 0 : pairs_.back().from_s - pairs_.front().from_s;
    const double block_s = std::min(kBlockS, record_s / kFewestBlocks);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero(), of_block = Eigen::Vector2d::Zero();
    double block_end_s = pairs_.empty() ? 0 : pairs_.front().from_s + block_s;
    const auto end_block = [&] { scores_ += of_block * of_block.transpose(), of_block.setZero(); };
    for (const Pair& pair : pairs_) {
      const double from_s = pair.from_s + offset_s, to_s = pair.to_s + offset_s;
      const auto from = own_.position(from_s), to = own_.position(to_s);
      if (!from || !to) continue;
      const double moved_m = *to - *from;
      const Eigen::Vector2d slope{ratio * (*own_.velocity(to_s) - *own_.velocity(from_s)), moved_m};
      const double rest_m = pair.step_m - ratio * moved_m;
      if (pair.from_s > block_end_s) {
        end_block();
        block_end_s = pair.from_s + block_s;
      }
      B_ += slope * slope.transpose();
      of_block += slope * rest_m;
      sum += slope * rest_m;
    }
    end_block();
    return B_.inverse() * sum;
  }

  std::vector<Pair> pairs_;
  Between own_;
  Eigen::Matrix2d B_ = Eigen::Matrix2d::Zero(), scores_ = Eigen::Matrix2d::Zero();
};

double rounded(double value) { return std::round(1e3 * value) / 1e3; }

ClockAlignment refused(std::string why) {
  ClockAlignment result;
  result.refusal = std::move(why);
  return result;
}

}  // namespace

ClockAlignment align_clocks(PositionRecord outside, PositionRecord own, OffsetRange range) {
  check(outside, "the outside record");
  check(own, "the robot's record");
  for (const PositionRecord& record : {outside, own}) {
    if (record.time_s.size() < 2 || !(record.time_s.back() - record.time_s.front() > 2 * kWindowS)) {
      return refused(base::join_text("a record of more than ", 2 * kWindowS, " s of each is needed"));
    }
    if (record.time_s.back() - record.time_s.front() > kLongestRecordS) {
      return refused(base::join_text("a record is longer than ", kLongestRecordS, " s: give the part with the run"));
    }
  }
  const Motion outside_motion = motion_of(outside), own_motion = motion_of(own);
  const double least_m = std::min(outside_motion.largest_m(), own_motion.largest_m());
  if (least_m < kLeastMotionM) {
    return refused(base::join_text(own_motion.largest_m() <= outside_motion.largest_m()
                                       ? "by its own record the robot"
                                       : "by the outside record the robot",
                                   " moves by at most ", rounded(1e3 * least_m), " mm in ", kWindowS, " s, and ",
                                   1e3 * kLeastMotionM, " mm are needed"));
  }
  const Correlogram found = correlogram(outside_motion, own_motion, range);
  const auto best = static_cast<std::size_t>(std::ranges::max_element(found.rho) - found.rho.begin());
  if (!(found.rho[best] >= kLeastCorrelation)) {
    return refused(base::join_text("the two motions resemble each other too little: their correlation is at most ",
                                   rounded(std::max(0.0, found.rho[best])), ", at an offset of ",
                                   rounded(found.offset_s(best)), " s, and ", kLeastCorrelation, " is needed"));
  }
  if (const auto rival = rival_of(found, best)) {
    return refused(base::join_text(
        "two offsets fit nearly as well, ", rounded(found.offset_s(best)), " s (correlation ", rounded(found.rho[best]),
        ") and ", rounded(found.offset_s(*rival)), " s (", rounded(found.rho[*rival]), "): the motion repeats itself"));
  }
  if (const double width_s = plateau_s(found, best); width_s > kWidestPlateauS) {
    return refused(base::join_text("offsets over ", rounded(width_s), " s fit nearly alike around ",
                                   rounded(found.offset_s(best)), " s: the speed changes too little"));
  }
  OffsetFit fit{outside, own};
  if (!fit.run(found.offset_s(best))) {
    return refused(base::join_text("the offset of ", rounded(found.offset_s(best)), " s cannot be made more exact"));
  }
  return {{}, fit.offset_s, fit.offset_sd_s(), found.rho[best], fit.ratio};
}

}  // namespace control
