// Tests each channel's residuals, and words what is found with its numbers and a way out.
#include "control/identification/residual_doubts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "control/identification/identifiability.hpp"
#include "control/search/fit_statistics.hpp"
#include "control/sensor/position_weight.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kFitOfRounding = 100 - 1e-6;  // percent; what is left is no noise
constexpr double kOutlier = 6;                 // robust sd
constexpr double kDoubtfulMean = 4;            // of its sigmas
constexpr double kWhite = 0.01;

struct ChannelResidual {
  const char* name;
  const char* unit;
  std::vector<double> residual;  // of the values that count
  std::vector<double> sample;    // of each
  double fit_percent;
  double whiteness_p_value;
};

std::vector<double> counted(const OutputErrorSearch& search, const Eigen::VectorXd& values) {
  const Eigen::VectorXd some = search.counted(values);
  return {some.begin(), some.end()};
}

std::ostringstream three_digits() {
  std::ostringstream text;
  text.precision(3);
  return text;
}

void add_poor_fit(const ChannelResidual& channel, const Fit& fit, std::vector<std::string>& warnings) {
  if (channel.fit_percent >= kPoorFitPercent) return;
  if (fit.sensor && describes_run(fit)) return;  // noise is larger than motion
  std::ostringstream text = three_digits();
  text << "the model explains only " << channel.fit_percent << " % of " << channel.name
       << ": it does not describe the run; look for a wrong sign or unit, columns that are shifted in time, "
          "disturbances, or noise as large as the motion";
  warnings.push_back(text.str());
}

// When the sample was measured.
double time_of(const Recording& recording, std::size_t k) {
  return recording.position_time_s.empty() ? recording.dt_s * static_cast<double>(k) : recording.position_time_s[k];
}

void add_outliers(const ChannelResidual& channel, const Recording& recording, Cost cost,
                  std::vector<std::string>& warnings) {
  const double middle = median(channel.residual);
  std::vector<double> size;
  for (const double r : channel.residual) size.push_back(std::abs(r - middle));
  const double limit = kOutlier * 1.4826 * median(size);
  if (!(limit > 0)) return;
  const auto count = std::ranges::count_if(size, [&](double s) { return s > limit; });
  if (count == 0) return;
  const auto first = std::ranges::find_if(size, [&](double s) { return s > limit; }) - size.begin();
  const auto sample = static_cast<std::size_t>(channel.sample[static_cast<std::size_t>(first)]);
  std::ostringstream text = three_digits();
  text << count << " of the " << size.size() << " values of " << channel.name << " lie beyond 6 robust sd (" << limit
       << ' ' << channel.unit << ") of the model, the first at " << time_of(recording, sample) << " s: "
       << (cost == Cost::least_squares ? "they draw the fit to them; repair them, or use the absolute error cost"
                                       : "they weigh little in the absolute error cost, but look at them");
  warnings.push_back(text.str());
}

void add_mean(const ChannelResidual& channel, std::vector<std::string>& warnings) {
  const Eigen::Map<const Eigen::VectorXd> r(channel.residual.data(), static_cast<Index>(channel.residual.size()));
  const double mean = r.mean(), n = static_cast<double>(r.size());
  const double sd = std::sqrt((r.array() - mean).square().sum() / n);
  const double sigma = sd * std::sqrt(samples_per_independent_one(r) / n);
  if (!(std::abs(mean) > kDoubtfulMean * sigma)) return;
  std::ostringstream text = three_digits();
  text << channel.name << " lies " << mean << ' ' << channel.unit << " beside the model in the mean, "
       << std::abs(mean) / sigma << " times what chance allows: remove the sensor's bias";
  warnings.push_back(text.str());
}

void add_colour(const ChannelResidual& channel, std::vector<std::string>& warnings) {
  if (channel.whiteness_p_value >= kWhite) return;
  std::ostringstream text = three_digits();
  text << "the residuals of " << channel.name << " are not white (Ljung-Box p = " << channel.whiteness_p_value
       << ", below 0.01): the sigmas are too small; look for disturbances, a dead time, or noise that is filtered";
  warnings.push_back(text.str());
}

// Under noise a slow drift is too small for the short lags of the whiteness.
void add_drift(const ChannelResidual& channel, double duration_s, std::vector<std::string>& warnings) {
  if (channel.whiteness_p_value < kWhite) return;
  const Eigen::Map<const Eigen::VectorXd> r(channel.residual.data(), static_cast<Index>(channel.residual.size()));
  const double factor = drift_factor(r, values_in_2_s(r.size(), duration_s));
  if (!(factor > 1)) return;
  std::ostringstream text;
  text.precision(2);
  text << "the residuals of " << channel.name
       << " drift: they look white from value to value, but their means over 2 s "
       << "and more scatter " << factor
       << " times as much as those of white noise; the sigmas may be too small by up to "
       << "this factor; look for a flow, or a sensor that drifts";
  warnings.push_back(text.str());
}

}  // namespace

double fit_percent(const OutputErrorSearch& search, const std::vector<double>& residual,
                   const std::vector<double>& measured, const std::vector<double>& sd_m) {
  if (residual.empty()) return std::numeric_limits<double>::infinity();
  const auto n = static_cast<Index>(residual.size());
  const Eigen::VectorXd r = search.counted(Eigen::Map<const Eigen::VectorXd>(residual.data(), n));
  const Eigen::ArrayXd y = search.counted(Eigen::Map<const Eigen::VectorXd>(measured.data(), n));
  Eigen::ArrayXd weight = Eigen::ArrayXd::Ones(y.size());
  if (!sd_m.empty()) weight = sd_of_mean_weight(sd_m) / Eigen::Map<const Eigen::ArrayXd>(sd_m.data(), n);
  const double mean = (weight.square() * y).sum() / weight.square().sum();
  return 100 * (1 - r.norm() / (weight * (y - mean)).matrix().norm());
}

std::vector<std::string> residual_doubts(const OutputErrorSearch& search, const Recording& recording,
                                         const IdentificationOptions& options, const Fit& fit) {
  if (fit.end != SearchEnd::converged && fit.end != SearchEnd::iteration_limit) return {};  // not the model's doing
  std::vector<ChannelResidual> channels;
  const auto take = [&](const char* name, const char* unit, const std::vector<double>& residual,
                        const std::vector<double>& measured, std::optional<double> p_value,
                        const std::vector<double>& sd_m = {}) {
    const double percent = fit_percent(search, residual, measured, sd_m);
    if (!(percent < kFitOfRounding)) return;
    const auto n = static_cast<Index>(residual.size());
    channels.push_back({name, unit, counted(search, Eigen::Map<const Eigen::VectorXd>(residual.data(), n)),
                        counted(search, Eigen::VectorXd::LinSpaced(n, 0, static_cast<double>(n - 1))), percent,
                        p_value.value_or(1)});
  };
  const char* position_unit = recording.position_sd_m.empty() ? "m" : "m as weighed by position_sd_m";
  take("position_m", position_unit, fit.position_residual_m, recording.position_m, fit.position_whiteness_p_value,
       recording.position_sd_m);
  take("acceleration_m_s2", "m/s²", fit.acceleration_residual_m_s2, recording.acceleration_m_s2,
       fit.acceleration_whiteness_p_value);
  take("velocity_m_s", "m/s", fit.velocity_residual_m_s, recording.velocity_m_s, fit.velocity_whiteness_p_value);

  std::vector<std::string> warnings;
  for (const ChannelResidual& channel : channels) add_outliers(channel, recording, options.cost, warnings);
  for (const ChannelResidual& channel : channels) add_poor_fit(channel, fit, warnings);
  for (const ChannelResidual& channel : channels) add_mean(channel, warnings);
  for (const ChannelResidual& channel : channels) add_colour(channel, warnings);
  const double duration_s = recording.dt_s * static_cast<double>(recording.duty.size());
  for (const ChannelResidual& channel : channels) add_drift(channel, duration_s, warnings);
  return warnings;
}

}  // namespace control
