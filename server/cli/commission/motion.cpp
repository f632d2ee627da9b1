// Edges, responses, and what follows from them.
#include "server/cli/commission/motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace server::cli {
namespace {

using nlohmann::json;

constexpr std::int64_t kTickUs = 10'000;
constexpr double kTickS = 0.01;
constexpr double kSeenSd = 4;  // of the noise
// m/s per duty of the paper's slower fluid, (29), and the share of it that is reached within the window.
constexpr double kSlowestMS = 0.1, kSlowestShare = 0.8;
constexpr double kWellBelow = 4;  // the noise has to lie this factor below it before no motion is believed
constexpr auto kWindow = static_cast<std::size_t>(kResponseWindowS / kTickS);

constexpr const char* kSettings = "robot_fw/esp8266/settings.hpp";
constexpr const char* kWires = "swap the motor's two wires, and begin again";

// The change of velocity that follows an edge; none where the window is not whole.
std::optional<double> change_after(const std::vector<RecordedSample>& samples, std::size_t edge) {
  if (edge + kWindow > samples.size()) return std::nullopt;
  double sum_m_s2 = 0;
  for (std::size_t i = edge; i < edge + kWindow; ++i) {
    const bool is_whole = samples[i].robot_time_us - samples[i - 1].robot_time_us == kTickUs;
    if (!is_whole || samples[i].duty != samples[edge].duty) return std::nullopt;
    sum_m_s2 += samples[i].acceleration_m_s2;
  }
  return sum_m_s2 * kTickS;
}

int sign_of(const Response& response) {
  if (!response.is_seen()) return 0;
  return (response.velocity_m_s > 0) == (response.duty > 0) ? 1 : -1;
}

std::string response_text(const Response& response) {
  return fmt::format("{:+.1f} ± {:.1f} mm/s within {:.2f} s of a duty of {:+.2f}", 1e3 * response.velocity_m_s,
                     2e3 * response.sd_m_s, kResponseWindowS, response.duty);
}

const char* word_of(SeenByPerson person) {
  switch (person) {
    case SeenByPerson::forwards: return "forwards";
    case SeenByPerson::backwards: return "backwards";
    case SeenByPerson::nothing: return "nothing";
  }
  return "nothing";
}

nlohmann::ordered_json direction_figures(const DirectionFacts& facts) {
  return {{"duty", facts.response.duty},
          {"response_m_s", facts.response.velocity_m_s},
          {"response_sd_m_s", facts.response.sd_m_s},
          {"edges", facts.response.edges()},
          {"person", word_of(facts.person)}};
}

// Between which two duties of one direction the motor begins to move the robot.
struct Bracket {
  std::optional<double> still, moving;  // magnitudes
};

Bracket bracket_of(std::vector<Response> responses, int direction) {
  std::erase_if(responses, [direction](const Response& one) { return (one.duty > 0) != (direction > 0); });
  std::ranges::sort(responses, {}, [](const Response& one) { return std::abs(one.duty); });
  Bracket bracket;
  for (auto one = responses.rbegin(); one != responses.rend(); ++one) {
    if (!one->is_seen()) {
      bracket.still = std::abs(one->duty);
      break;
    }
    bracket.moving = std::abs(one->duty);
  }
  return bracket;
}

// SAFETY: of the same duty both ways the accelerometer saw motion one way.
bool does_not_reverse(const std::vector<Response>& responses) {
  return std::ranges::any_of(responses, [&responses](const Response& forwards) {
    return std::ranges::any_of(responses, [&forwards](const Response& backwards) {
      return forwards.duty > 0 && backwards.duty == -forwards.duty && sign_of(forwards) * sign_of(backwards) < 0;
    });
  });
}

std::string bracket_text(const Bracket& bracket) {
  if (!bracket.moving) return fmt::format("no motion seen up to {:.2f}", bracket.still.value_or(0));
  if (!bracket.still) return fmt::format("motion seen from {:.2f} on, the smallest that was tried", *bracket.moving);
  return fmt::format("no motion seen at {:.2f}, and from {:.2f} on", *bracket.still, *bracket.moving);
}

nlohmann::ordered_json bracket_json(const Bracket& bracket) {
  const auto number = [](const std::optional<double>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
  };
  return {{"still_at", number(bracket.still)}, {"moves_at", number(bracket.moving)}};
}

// Both lags of b1 s² + b2 s + 1 where its roots are real, the shorter one first.
using Lags = std::array<double, 2>;
std::optional<Lags> lags_of(double b1, double b2) {
  const double inside = b2 * b2 - 4 * b1;
  if (!(b1 >= 0 && b2 > 0 && inside >= 0)) return std::nullopt;
  const double root = std::sqrt(inside);
  return Lags{(b2 - root) / 2, (b2 + root) / 2};
}

// One sigma of each lag, by differences, with the correlation of b1 and b2.
std::optional<Lags> sigmas_of(double b1, double b2, double sigma_1, double sigma_2, double correlation) {
  constexpr double kStep = 1e-3;
  const auto middle = lags_of(b1, b2), by_b1 = lags_of(b1 * (1 - kStep), b2), by_b2 = lags_of(b1, b2 * (1 + kStep));
  if (!middle || !by_b1 || !by_b2 || b1 == 0) return std::nullopt;
  Lags sigmas{};
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    const double slope_1 = ((*middle)[i] - (*by_b1)[i]) / (kStep * b1) * sigma_1;
    const double slope_2 = ((*by_b2)[i] - (*middle)[i]) / (kStep * b2) * sigma_2;
    sigmas[i] = std::sqrt(std::max(0.0, slope_1 * slope_1 + slope_2 * slope_2 + 2 * correlation * slope_1 * slope_2));
  }
  return sigmas;
}

double number_in(const json& object, const char* name) {
  const json value = object.value(name, json());
  return value.is_number() ? value.get<double>() : std::nan("");
}

// Of b1 and b2 in the fit.
double correlation_of(const json& fit) {
  const json names = fit.value("correlation_of", json::array()), rows = fit.value("correlation", json::array());
  const auto b1 = std::ranges::find(names, json("b1")) - names.begin();
  const auto b2 = std::ranges::find(names, json("b2")) - names.begin();
  const auto count = static_cast<std::ptrdiff_t>(rows.size());
  if (b1 >= count || b2 >= count) return 0;
  const json& row = rows[static_cast<std::size_t>(b1)];
  const json value = row.is_array() && b2 < std::ssize(row) ? row[static_cast<std::size_t>(b2)] : json();
  return value.is_number() ? value.get<double>() : 0;
}

}  // namespace

bool Response::is_seen() const { return edges() > 0 && std::abs(velocity_m_s) > kSeenSd * sd_m_s; }

std::vector<Response> responses_of(const std::vector<RecordedSample>& samples, double noise_m_s2) {
  struct Changes {
    double sum_m_s = 0;
    std::size_t rising = 0, falling = 0;
  };
  std::map<long, Changes> changes;  // by the duty in hundredths of a percent
  constexpr double kDutySteps = 1e4;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double before = samples[i - 1].duty, after = samples[i].duty;
    if (before == after || (before != 0 && after != 0)) continue;
    const auto change = change_after(samples, i);
    if (!change) continue;
    Changes& of_duty = changes[std::lround(kDutySteps * (before + after))];
    of_duty.sum_m_s += after == 0 ? -*change : *change;
    ++(after == 0 ? of_duty.falling : of_duty.rising);
  }
  std::vector<Response> responses;
  for (const auto& [duty, seen] : changes) {
    const auto count = static_cast<double>(seen.rising + seen.falling);
    responses.push_back({static_cast<double>(duty) / kDutySteps, seen.sum_m_s / count,
                         noise_m_s2 * kTickS * std::sqrt(static_cast<double>(kWindow) / count), seen.rising,
                         seen.falling});
  }
  return responses;
}

StepFinding judge_motor_direction(const DirectionFacts& facts) {
  StepFinding finding{.step = "motor_direction",
                      .verdict = Verdict::pass,
                      .found = fmt::format("a duty of {:+.2f} drove it {}, by the word of who watched",
                                           facts.response.duty, word_of(facts.person)),
                      .bound = "a duty above 0 drives it forwards"};
  finding.figures = direction_figures(facts);
  if (facts.person == SeenByPerson::backwards) {
    finding.verdict = Verdict::fail;
    finding.found += ": the motor is reversed";
    finding.action = kWires;
  } else if (facts.person == SeenByPerson::nothing) {
    finding.verdict = Verdict::fail;
    finding.found = fmt::format("a duty of {:+.2f} moved nothing, by the word of who watched", facts.response.duty);
    finding.action =
        facts.response.is_seen()
            ? "the accelerometer saw motion: look again, or see whether the motor shakes a robot that is held"
            : "does the propeller turn? See to battery, driver and propeller, or allow more with --duty";
  }
  return finding;
}

StepFinding judge_imu_axis(const DirectionFacts& facts) {
  StepFinding finding{.step = "imu_axis",
                      .verdict = Verdict::pass,
                      .found = "the accelerometer saw " + response_text(facts.response),
                      .bound = "the sign of the motion that the person saw, beyond 4 sd of its noise"};
  finding.figures = direction_figures(facts);
  const auto unknown = [&finding](const char* why, const char* action) {
    StepFinding left_out = not_done("imu_axis", why);
    left_out.action = action;
    left_out.figures = finding.figures;
    return left_out;
  };
  if (facts.person == SeenByPerson::nothing) {
    return unknown("without a motion that the person saw nothing can be said of the axis", "");
  }
  // With as many edges of both kinds an error of the bias cancels; with one more it looks like motion.
  if (facts.response.edges() == 0 || facts.response.rising != facts.response.falling) {
    return unknown("samples are missing where the duty changed", "see to the link, and push again");
  }
  const double slowest_m_s = kSlowestShare * kSlowestMS * std::abs(facts.response.duty);
  const bool hides = !facts.is_noise_sound || kWellBelow * kSeenSd * facts.response.sd_m_s > slowest_m_s;
  if (hides && !facts.response.is_seen()) {
    return unknown("the noise hides it", "see to the noise (imu_noise), or allow more with --duty");
  }
  const int seen = sign_of(facts.response), moved = facts.person == SeenByPerson::forwards ? 1 : -1;
  if (seen == 0) {
    finding.verdict = Verdict::fail;
    finding.found += ", which is none: its axis lies across the tube";
    finding.action = fmt::format("set `axis` in {} to another of 0, 1, 2, flash, and begin again", kSettings);
  } else if (seen != moved) {
    finding.verdict = Verdict::fail;
    finding.found += fmt::format(" while it moved {}: its axis is the wrong way round", word_of(facts.person));
    finding.action = fmt::format("turn `reversed` in {} round, flash, and begin again", kSettings);
  }
  return finding;
}

std::optional<DeadZoneToSet> dead_zone_to_set(const DeadZoneFacts& facts) {
  const Bracket forwards = bracket_of(facts.responses, 1), backwards = bracket_of(facts.responses, -1);
  if (!forwards.moving || (!facts.is_one_way && !backwards.moving)) return std::nullopt;
  const double still = forwards.still.value_or(0);
  const DeadZoneToSet zone{facts.is_one_way ? still : std::min(still, backwards.still.value_or(0)),
                           facts.is_one_way ? *forwards.moving : std::max(*forwards.moving, *backwards.moving)};
  if (facts.parameter >= zone.still && facts.parameter <= zone.moving) return std::nullopt;
  return zone;
}

StepFinding judge_dead_zone(const DeadZoneFacts& facts) {
  const Bracket forwards = bracket_of(facts.responses, 1), backwards = bracket_of(facts.responses, -1);
  StepFinding finding{
      .step = "dead_zone",
      .verdict = Verdict::pass,
      .bound = fmt::format("motion in each direction; the robot's dead_zone_duty ({:.3g}) within what was "
                           "found",
                           facts.parameter)};
  finding.found = "forwards: " + bracket_text(forwards) + "; backwards: " +
                  (facts.is_one_way ? std::string{"a motor without reverse"} : bracket_text(backwards));
  nlohmann::ordered_json responses = nlohmann::ordered_json::array();
  for (const Response& one : facts.responses) {
    responses.push_back({{"duty", one.duty},
                         {"velocity_m_s", one.velocity_m_s},
                         {"sd_m_s", one.sd_m_s},
                         {"edges", one.edges()},
                         {"seen", one.is_seen()}});
  }
  finding.figures = {{"forwards", bracket_json(forwards)},
                     {"backwards", facts.is_one_way ? nlohmann::ordered_json(nullptr) : bracket_json(backwards)},
                     {"one_way", facts.is_one_way},
                     {"dead_zone_duty", facts.parameter},
                     {"responses", responses}};
  // With as many edges of both kinds an error of the bias cancels.
  const auto is_whole = [](const Response& one) { return one.edges() > 0 && one.rising == one.falling; };
  const auto whole = static_cast<std::size_t>(std::ranges::count_if(facts.responses, is_whole));
  if (whole < facts.tried) {
    finding.verdict = Verdict::not_done;
    finding.found = fmt::format("samples are missing: {} of {} duties can be judged", whole, facts.tried);
    finding.action = "see to the link, and push again";
    return finding;
  }
  if (facts.is_one_way && facts.backwards == DutyAnswer::none) {
    finding.verdict = Verdict::not_done;
    finding.found += ", but nothing says what the robot does with a duty below 0";
    finding.action = "see whether another command stood in the way, and begin again";
    return finding;
  }
  if (!forwards.moving || (!facts.is_one_way && !backwards.moving)) {
    finding.verdict = Verdict::fail;
    finding.action = "the accelerometer saw no motion: see whether the propeller turns, or allow more duty (--duty)";
  } else if (!facts.is_one_way && does_not_reverse(facts.responses)) {
    finding.verdict = Verdict::fail;
    finding.found += ", but the reverse does not reverse: a duty below 0 drives it as one above 0 does";
    finding.action = "see to the wire of `direction_pin` and to the driver (docs/hardware.md, Wiring)";
  } else if (facts.is_one_way && facts.backwards == DutyAnswer::taken) {
    finding.verdict = Verdict::fail;
    finding.found += ", but the robot took a duty below 0";
    finding.action =
        "if the motor reverses, send a controller that may use it (duty_min), and begin again; if not, see to "
        "`direction_pin` and the duty range in robot_fw/esp8266/settings.hpp";
  } else if (facts.is_one_way && facts.backwards == DutyAnswer::refused_by_station) {
    finding.verdict = Verdict::attention;
    finding.found += "; the station's limits let no duty below 0 through, so the robot itself was not asked";
    finding.action = "commission it again before that limit (duty_min) is widened";
  } else if (const auto zone = dead_zone_to_set(facts)) {
    finding.verdict = Verdict::attention;
    finding.action = fmt::format(
        "watch the propeller at a duty of {:.2f}: if it stands still, set `dead_zone` in {} to {:.2f}, or the "
        "parameters dead_zone_duty to {:.2f} and doubtful_duty to {:.2f} at least; if it turns, the motion is lost in "
        "the noise",
        zone->still, kSettings, zone->middle(), zone->still, zone->moving);
  }
  return finding;
}

std::optional<double> gain_of(const MotorFacts& facts) {
  if (!facts.fit.is_object() || !facts.fit.contains("parameters")) return std::nullopt;
  const double gain = number_in(facts.fit.at("parameters"), "kp") / number_in(facts.fit.at("parameters"), "b3");
  return std::isfinite(gain) ? std::optional{gain} : std::nullopt;
}

StepFinding judge_motor_constant(const MotorFacts& facts) {
  constexpr double kPoorGain = 0.1, kPoorLag = 0.5;  // one sigma, relative
  StepFinding finding{.step = "motor_constant",
                      .verdict = Verdict::pass,
                      .bound = fmt::format("a gain above 0, known within {:.0f} % (one sigma)", 100 * kPoorGain)};
  const auto gain = gain_of(facts);
  if (!gain) {
    finding.verdict = Verdict::fail;
    finding.found = "no model was found: " + (facts.failure.empty() ? std::string{"no finite result"} : facts.failure);
    finding.action = "look at the run: gaps, a fault of the sensor, a motor that did not turn";
    return finding;
  }
  const json parameters = facts.fit.at("parameters"), sigma = facts.fit.value("one_sigma", json::object());
  const double b1 = number_in(parameters, "b1"), b2 = number_in(parameters, "b2");
  const double gain_sigma = number_in(sigma, "kp");
  const auto lags = lags_of(b1, b2);
  const auto lag_sigmas = sigmas_of(b1, b2, number_in(sigma, "b1"), number_in(sigma, "b2"), correlation_of(facts.fit));
  const json warnings = facts.fit.value("warnings", json::array());
  finding.figures = {{"gain_m_s", *gain}, {"gain_sigma_m_s", gain_sigma}};
  finding.found = fmt::format("{:.4f} ± {:.4f} m/s per duty", *gain, gain_sigma);
  if (lags && lag_sigmas) {
    finding.found +=
        fmt::format(", lags {:.0f} ± {:.0f} and {:.0f} ± {:.0f} ms (one sigma); the motor of (27) has 22 ms",
                    1e3 * (*lags)[0], 1e3 * (*lag_sigmas)[0], 1e3 * (*lags)[1], 1e3 * (*lag_sigmas)[1]);
    finding.figures["lags_s"] = *lags;
    finding.figures["lag_sigmas_s"] = *lag_sigmas;
  } else {
    finding.found += "; both lags are not told apart";
  }
  finding.figures["fit_percent"] = facts.fit.value("fit_percent", json());
  finding.figures["end"] = facts.fit.value("end", json());
  finding.figures["residuals_are_white"] = facts.fit.value("residuals_are_white", json());
  finding.figures["warnings"] = warnings;
  const bool is_white = facts.fit.value("residuals_are_white", json()) == true;
  const bool has_converged = facts.fit.value("end", json()) == "converged";
  if (!(*gain > 0)) {
    finding.verdict = Verdict::fail;
    finding.action = "the robot moves against its duty: see to motor and axis first";
  } else if (!(gain_sigma <= kPoorGain * *gain)) {
    finding.verdict = Verdict::attention;
    finding.action = "the step says too little: repeat with more --duty, or in a fluid at rest";
  } else if (!has_converged || !is_white || (lags && lag_sigmas && (*lag_sigmas)[0] > kPoorLag * (*lags)[0])) {
    finding.verdict = Verdict::attention;
    finding.action =
        "take it for a first figure: a fluid with orders of its own needs `identification_set` "
        "(docs/first_robot.md, step 5)";
  }
  return finding;
}

}  // namespace server::cli
