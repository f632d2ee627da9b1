// One least-squares fit of duty and acceleration, then a ratio at each tone.
#include "control/tuning/three_tones.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <numbers>
#include <sstream>
#include <vector>

#include "base/invalid_argument.hpp"
#include "control/sensor/sensor_readings.hpp"

namespace control {
namespace {

using Complex = std::complex<double>;
using std::numbers::pi;

constexpr double kTonesPerCrossover[] = {0.7, 1, 1.4};
constexpr int kPeriodsOfCrossover = 10;  // in the shortest window with whole periods of all tones
constexpr int kDriftTerms = 3;
constexpr int kNoiseLines = 2;       // of (5), on either side
constexpr double kLeastRatio = 5;    // of a tone to what is not explained beside it
constexpr double kLeastDuty = 1e-4;  // of a tone
constexpr std::size_t kTones = std::size(kTonesPerCrossover);

void check(const ToneRecord& record, double crossover_rad_s) {
  if (!base::is_positive(crossover_rad_s)) {
    base::throw_invalid("three tones: the crossover must be positive, is ", crossover_rad_s);
  }
  if (!base::is_positive(record.dt_s)) base::throw_invalid("three tones: dt_s must be positive, is ", record.dt_s);
  if (record.duty.size() != record.acceleration_m_s2.size()) {
    base::throw_invalid("three tones: there are ", record.duty.size(), " duties and ", record.acceleration_m_s2.size(),
                        " accelerations");
  }
  base::check_not_negative("three tones", "from_s", record.from_s);
  base::check_not_negative("three tones", "sensor_lag_s", record.sensor_lag_s);
  if (kTonesPerCrossover[kTones - 1] * crossover_rad_s * record.dt_s >= pi / 2) {
    base::throw_invalid("three tones: at ", crossover_rad_s,
                        " rad/s the highest tone has fewer than 4 samples a period");
  }
}

// The last whole periods of the record.
struct Window {
  std::size_t first = 0, count = 0;
};

Window window_of(const ToneRecord& record, double crossover_rad_s) {
  const double period_s = tone_window_s(crossover_rad_s);
  const double there_s = static_cast<double>(record.duty.size()) * record.dt_s - record.from_s;
  const double periods = std::floor(there_s / period_s + 1e-9);
  if (!(periods >= 1)) return {};
  const auto count = static_cast<std::size_t>(std::lround(periods * period_s / record.dt_s));
  if (count > record.duty.size()) return {};
  return {record.duty.size() - count, count};
}

// The columns of (2): drift, then cosine and sine of each tone.
Eigen::MatrixXd regressors(const std::array<double, kTones>& tones_rad_s, std::size_t count, double dt_s) {
  const auto rows = static_cast<Eigen::Index>(count);
  Eigen::MatrixXd columns{rows, kDriftTerms + 2 * static_cast<Eigen::Index>(kTones)};
  for (Eigen::Index k = 0; k < rows; ++k) {
    const double share = 2.0 * static_cast<double>(k) / static_cast<double>(rows) - 1;  // in place of t, of order 1
    columns.row(k).head<kDriftTerms>() << 1, share, share * share;
    for (std::size_t i = 0; i < kTones; ++i) {
      const double angle_rad = tones_rad_s[i] * static_cast<double>(k) * dt_s;
      const auto at = kDriftTerms + 2 * static_cast<Eigen::Index>(i);
      columns(k, at) = std::cos(angle_rad);
      columns(k, at + 1) = std::sin(angle_rad);
    }
  }
  return columns;
}

// Amplitudes of the tones in a signal, as Re[C e^{jωt}], and what is left of it.
struct Tones {
  std::array<Complex, kTones> amplitude;
  Eigen::VectorXd rest;
};

Tones tones_in(const Eigen::VectorXd& signal, const Eigen::MatrixXd& columns,
               const Eigen::HouseholderQR<Eigen::MatrixXd>& solver) {
  const Eigen::VectorXd found = solver.solve(signal);
  Tones tones;
  for (std::size_t i = 0; i < kTones; ++i) {
    const auto at = kDriftTerms + 2 * static_cast<Eigen::Index>(i);
    tones.amplitude[i] = {found(at), -found(at + 1)};
  }
  tones.rest = signal - columns * found;
  return tones;
}

// The amplitude of one line of the window's spectrum.
Complex line_of(const Eigen::VectorXd& signal, double omega_rad_s, double dt_s) {
  Complex sum = 0;
  for (Eigen::Index k = 0; k < signal.size(); ++k) {
    sum += signal(k) * std::polar(1.0, -omega_rad_s * static_cast<double>(k) * dt_s);
  }
  return 2.0 * sum / static_cast<double>(signal.size());
}

// (5): the root of the mean of |E|².
double unexplained(const Tones& duty, const Tones& acceleration, std::size_t tone, double omega_rad_s, double dt_s) {
  const Complex ratio = acceleration.amplitude[tone] / duty.amplitude[tone];
  const double line_rad_s = 2 * pi / (static_cast<double>(duty.rest.size()) * dt_s);
  double sum = 0;
  for (int line = 1; line <= kNoiseLines; ++line) {
    for (const double side : {-1.0, 1.0}) {
      const double beside_rad_s = omega_rad_s + side * line * line_rad_s;
      sum += std::norm(line_of(acceleration.rest, beside_rad_s, dt_s) - ratio * line_of(duty.rest, beside_rad_s, dt_s));
    }
  }
  return std::sqrt(sum / (2 * kNoiseLines));
}

// (3)
Complex position_per_duty(Complex ratio, double omega_rad_s, const ToneRecord& record) {
  const double turn_rad = omega_rad_s * record.dt_s;
  const Complex held = (1.0 - std::polar(1.0, -turn_rad)) / Complex{0, turn_rad};
  return ratio * std::polar(1.0, omega_rad_s * record.sensor_lag_s) / (-omega_rad_s * omega_rad_s * held);
}

std::string too_weak(const MeasuredPoint& point, double unexplained_m_s2) {
  std::ostringstream text;
  text.precision(3);
  if (point.duty < kLeastDuty) {
    text << "the duty has no tone at " << point.omega_rad_s << " rad/s (" << point.duty << ")";
  } else {
    text << "the tone at " << point.omega_rad_s << " rad/s shows in the acceleration by " << point.acceleration
         << " m/s², and " << unexplained_m_s2
         << " m/s² beside it are not explained; use a larger tone or a longer record";
  }
  return text.str();
}

std::string too_short(const ToneRecord& record, double crossover_rad_s) {
  std::ostringstream text;
  text.precision(4);
  text << "the record has " << static_cast<double>(record.duty.size()) * record.dt_s - record.from_s
       << " s of tones; a whole period of all three at " << crossover_rad_s << " rad/s takes "
       << tone_window_s(crossover_rad_s) << " s";
  return text.str();
}

// The phase of a position falls from -90° on: in (-2π, 0]. The outer ones lie next to it.
void unwrap(std::array<MeasuredPoint, kTones>& points) {
  if (points[1].phase_rad > 0) points[1].phase_rad -= 2 * pi;
  for (MeasuredPoint* outer : {&points[0], &points[2]}) {
    outer->phase_rad -= 2 * pi * std::round((outer->phase_rad - points[1].phase_rad) / (2 * pi));
  }
}

// (4)
void measure_slope(MeasuredPlant& plant) {
  const auto& p = plant.points;
  const double below = std::log(p[0].omega_rad_s / p[1].omega_rad_s);
  const double above = std::log(p[2].omega_rad_s / p[1].omega_rad_s);
  const double weights[] = {-above / (below * (below - above)), -(below + above) / (below * above),
                            -below / (above * (above - below))};
  double variance = 0;
  for (std::size_t i = 0; i < kTones; ++i) {
    plant.phase_fall -= weights[i] * p[i].phase_rad;
    variance += weights[i] * weights[i] * p[i].sigma * p[i].sigma;
  }
  plant.phase_fall_sigma = std::sqrt(variance);
}

}  // namespace

std::array<double, 3> three_tones_rad_s(double crossover_rad_s) {
  std::array<double, kTones> tones{};
  for (std::size_t i = 0; i < kTones; ++i) tones[i] = kTonesPerCrossover[i] * crossover_rad_s;
  return tones;
}

double tone_window_s(double crossover_rad_s) { return kPeriodsOfCrossover * 2 * pi / crossover_rad_s; }

MeasuredPlant measure_three_tones(const ToneRecord& record, double crossover_rad_s) {
  check(record, crossover_rad_s);
  MeasuredPlant plant;
  const Window window = window_of(record, crossover_rad_s);
  if (window.count == 0) {
    plant.refusal = too_short(record, crossover_rad_s);
    return plant;
  }
  plant.used_s = static_cast<double>(window.count) * record.dt_s;
  const SensorReadings readings = sensor_readings(record.acceleration_m_s2);
  const auto part = [&window](std::span<const double> all) {
    return Eigen::VectorXd{
        Eigen::Map<const Eigen::VectorXd>{all.data() + window.first, static_cast<Eigen::Index>(window.count)}};
  };
  const auto omegas_rad_s = three_tones_rad_s(crossover_rad_s);
  const Eigen::MatrixXd columns = regressors(omegas_rad_s, window.count, record.dt_s);
  const Eigen::HouseholderQR<Eigen::MatrixXd> solver{columns};
  const Tones duty = tones_in(part(record.duty), columns, solver);
  const Tones acceleration = tones_in(part(readings.reading_m_s2), columns, solver);
  for (std::size_t i = 0; i < kTones; ++i) {
    MeasuredPoint& point = plant.points[i];
    point.omega_rad_s = omegas_rad_s[i];
    point.duty = std::abs(duty.amplitude[i]);
    point.acceleration = std::abs(acceleration.amplitude[i]);
    const double beside_m_s2 =
        point.duty < kLeastDuty ? 0 : unexplained(duty, acceleration, i, point.omega_rad_s, record.dt_s);
    if (point.duty < kLeastDuty || !(point.acceleration > kLeastRatio * beside_m_s2)) {
      plant.refusal = too_weak(point, beside_m_s2);
      return plant;
    }
    const Complex response =
        position_per_duty(acceleration.amplitude[i] / duty.amplitude[i], point.omega_rad_s, record);
    point.modulus = std::abs(response);
    point.phase_rad = std::arg(response);
    point.sigma = beside_m_s2 / std::numbers::sqrt2 / point.acceleration;  // (6)
  }
  unwrap(plant.points);
  measure_slope(plant);
  return plant;
}

}  // namespace control
