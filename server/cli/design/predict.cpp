// `rheonaut predict`.
#include "server/cli/design/predict.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include "server/analysis/control_json.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/analysis/metrics/run_steps.hpp"
#include "server/analysis/tuning/robot_controller.hpp"
#include "server/api/bodies/controller_body.hpp"
#include "server/cli/design/robustness_table.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/storage/samples/position_sd.hpp"

namespace server::cli {
namespace {

constexpr long long kLargestSeed = (1LL << 53) - 1;  // what JSON holds exactly

// What a run did, and when the experiment that is predicted began in it.
struct Measured {
  std::vector<analysis::MeasuredStep> steps;
  double began_at_s = 0;
  std::string position_source;                     // in words
  bool went_backwards = false;                     // some duty was below 0
  std::optional<protocol::Controller> controller;  // in force at the step; none: not known
  std::optional<std::uint32_t> controller_checksum;
};

double largest_sd_m(std::span<const analysis::MeasuredStep> steps, bool is_from_outside) {
  double largest_m = 0;
  for (const analysis::MeasuredStep& step : steps) {
    if (step.is_from_outside == is_from_outside) largest_m = storage::larger_sd_m(largest_m, step.position_sd_m);
  }
  return largest_m;
}

// From where the positions of the steps are had.
std::string source_in_words(std::span<const analysis::MeasuredStep> steps,
                            const std::optional<storage::StoredReference>& reference) {
  const double own_sd_m = largest_sd_m(steps, false);
  const std::string sd = analysis::position_sd_in_words(own_sd_m);
  const std::string own = storage::is_estimate(own_sd_m) ? fmt::format("the robot's own estimate ({})", sd)
                                                         : "the position is known: " + sd;
  if (!reference) return own;
  const auto outside = std::ranges::count(steps, true, &analysis::MeasuredStep::is_from_outside);
  if (outside == 0) {
    return own + "; the position from outside has no step with 10 positions and no pause over 0.25 s";
  }
  const std::string measured = fmt::format("position measured from outside ({}), ± {:.2g} mm",
                                           reference->reference.source, 2e3 * largest_sd_m(steps, true));
  if (outside == std::ssize(steps)) return measured;
  return fmt::format("{}, in {} of {} steps; in the others {}", measured, outside, steps.size(), own);
}

// The controller of the prediction, and where it is from.
struct Steering {
  bool is_runs_own = false;
  control::Discretisation controller;  // of a run's own: period, sections and DC gain alone
  double duty_min = -1, duty_max = 1;
  std::optional<std::uint32_t> checksum;  // as a robot computes it; none: no robot takes it
  std::string name;                       // in words
};

// As a robot computes it that steers by the error, as the prediction does; none: no robot takes this controller.
std::optional<std::uint32_t> checksum_of(const Steering& steering) {
  const nlohmann::json made(analysis::json_of(steering.controller));
  nlohmann::json sent{{"duty_min", steering.duty_min}, {"duty_max", steering.duty_max}, {"derivative_on", "error"}};
  for (const char* name : {"period_s", "dc_gain", "sections"}) sent["controller"][name] = made.at(name);
  const auto message = api::controller_from(api::Members{sent}, nullptr);
  return message ? std::optional{message->checksum} : std::nullopt;
}

Steering steering_of_run(const Predict& options, const protocol::Controller& of_run) {
  Steering steering;
  steering.is_runs_own = true;
  steering.controller.options.period_s = of_run.period_us / 1e6;
  steering.controller.sections = analysis::sections_of(of_run);
  steering.controller.dc_gain = of_run.kp;
  steering.duty_min = options.duty_min.value_or(of_run.duty_min);
  steering.duty_max = options.duty_max.value_or(of_run.duty_max);
  steering.checksum = of_run.checksum;
  steering.name = fmt::format("the run's controller {} (checksum {:08x})", of_run.controller_id, of_run.checksum);
  if (of_run.derivative_on == rheonaut_DERIVATIVE_ON_MEASUREMENT) {
    steering.name += ", whose derivative acts on the position, and in the prediction on the error";
  }
  return steering;
}

Steering steering_of(const Predict& options, const Measured& measured) {
  if (measured.controller && !options.controller.file) {
    if (options.sampling.method || options.sampling.a) {
      throw UsageError{"--method and --a need --controller: the run's own controller is discrete already"};
    }
    return steering_of_run(options, *measured.controller);
  }
  Steering steering;
  steering.controller = discretised(read(options.controller), options.sampling).chosen;
  steering.duty_min = options.duty_min.value_or(steering.duty_min);
  steering.duty_max = options.duty_max.value_or(steering.duty_max);
  steering.checksum = checksum_of(steering);
  steering.name = "controller " + options.controller.file.value_or("(30) of the paper");
  return steering;
}

// In words; empty where nothing can be compared.
std::string controllers_in_words(std::optional<std::uint32_t> predicted, std::optional<std::uint32_t> of_run) {
  if (!predicted || !of_run) return {};
  if (*predicted == *of_run) return fmt::format("; the run began with this controller (checksum {:08x})", *of_run);
  return fmt::format(
      "; the run began with ANOTHER controller: its checksum is {:08x}, that of the prediction {:08x}, so "
      "coefficients, period, duty range or derivative differ",
      *of_run, *predicted);
}

// In words: what the prediction assumes, and the run may not have had.
std::string predicted_with(const Predict& options, const Steering& steering, const Measured& measured) {
  std::string words = fmt::format("plant {}, {}, duty {:g} to {:g}", options.plant.file.value_or("(29) of the paper"),
                                  steering.name, steering.duty_min, steering.duty_max);
  if (steering.is_runs_own) return options.plant.file ? words : words + "; if the run had another plant, give --plant";
  if (!options.plant.file || !options.controller.file) {
    words += "; if the run had others, give --plant and --controller";
  }
  if (steering.duty_min < 0 && !measured.went_backwards) {
    words += "; the run's duty was never below 0: if its motor turns one way only, give --duty-min 0";
  }
  return words + controllers_in_words(steering.checksum, measured.controller_checksum);
}

double time_of(std::span<const analysis::StepPoint> points, std::uint32_t span, std::uint64_t seq) {
  const auto is_of_span = [span](const analysis::StepPoint& point) { return point.span == span; };
  const auto first = std::ranges::find_if(points, is_of_span);
  const auto at =
      std::ranges::find_if(first, points.end(), [seq](const analysis::StepPoint& point) { return point.seq == seq; });
  return static_cast<double>(at->robot_time_us - first->robot_time_us) * 1e-6;
}

// Makes the experiment the run's first step of setpoint, with the disturbance that follows it.
Measured follow(const RunChoice& choice, control::ClosedLoopExperiment& experiment) {
  const std::vector<storage::StoredSample> samples = read_samples(choice);
  std::vector<analysis::StepPoint> points;
  for (const storage::StoredSample& stored : samples) points.push_back(analysis::step_point(stored));
  const std::optional<storage::StoredReference> reference = read_reference(choice);
  Measured measured;
  measured.steps = measure_steps(points, reference ? &*reference : nullptr);
  const auto& steps = measured.steps;
  const auto first = std::ranges::find(steps, analysis::StepCause::setpoint, &analysis::MeasuredStep::cause);
  if (first == steps.end()) {
    throw std::runtime_error{fmt::format("run {} has no step of setpoint in auto mode to compare with", *choice.run)};
  }
  measured.began_at_s = first->at_s;
  measured.position_source = source_in_words(steps, reference);
  measured.went_backwards =
      std::ranges::any_of(samples, [](const storage::StoredSample& stored) { return stored.sample.duty < 0; });
  measured.controller_checksum = read_controller_checksum(choice);
  measured.controller = read_controller(choice, first->span, first->first_seq);
  experiment.setpoint_m = first->target_m - first->start_m;
  experiment.settling_band_m = first->band_m;  // of the robot's own step, also where the start is the true one
  experiment.duration_s = time_of(points, first->span, first->last_seq) - first->at_s;
  experiment.disturbance_at_s = 2 * experiment.duration_s;
  const auto next = first + 1;
  if (next != steps.end() && next->cause == analysis::StepCause::disturbance && next->span == first->span) {
    const auto at = std::ranges::find_if(points, [&](const analysis::StepPoint& point) {
      return point.span == next->span && point.seq == next->first_seq;
    });
    experiment.disturbance_m = static_cast<double>(at->disturbance_m) - static_cast<double>((at - 1)->disturbance_m);
    experiment.disturbance_at_s = next->at_s - first->at_s;
    experiment.duration_s = time_of(points, next->span, next->last_seq) - first->at_s;
  }
  return measured;
}

analysis::OrderedJson estimate_error_json(const std::optional<analysis::EstimateError>& error) {
  if (!error) return nullptr;
  return {{"rms_m", error->rms_m},
          {"worst_m", error->worst_m},
          {"within_2_sd", error->within_2_sd},
          {"samples", error->samples}};
}

analysis::OrderedJson measured_step_json(const analysis::MeasuredStep& step) {
  analysis::OrderedJson out = {{"cause", text(step.cause)},
                               {"span", step.span},
                               {"at_s", step.at_s},
                               {"start_m", step.start_m},
                               {"target_m", step.target_m},
                               {"band_m", step.band_m},
                               {"position_source", position_source(step)},
                               {"position_sd_m", step.position_sd_m},
                               {"estimate_error", estimate_error_json(step.estimate_error)}};
  out.update(analysis::json_of(step.metrics));
  out["position_doubt"] = analysis::position_doubt(analysis::json_of(step));
  return out;
}

// Of an estimated position with its ± 2 sd.
void add_row(Table& table, const std::string& name, double at_s, const control::StepMetrics& m,
             double position_sd_m = 0) {
  const std::string within = std::isnan(position_sd_m)             ? " ± not known"
                             : storage::is_estimate(position_sd_m) ? " ± " + fixed(2e3 * position_sd_m, 1)
                                                                   : "";
  table.row({name, cell(at_s, 5), m.settling_s ? cell(*m.settling_s, 4) : "never", fixed(m.overshoot_percent, 2),
             cell(m.rise_10_90_s, 4), fixed(1e3 * m.steady_state_error_m, 3) + within});
}

void write_table(std::ostream& out, const control::ClosedLoopExperiment& experiment,
                 const control::ClosedLoopPrediction& prediction, const Measured& measured, const std::string& with) {
  if (!measured.steps.empty()) {
    fmt::print(out, "compared with: {}\npredicted with: {}\n\n", measured.position_source, with);
  }
  Table table{{"step", "at (s)", "settling (s)", "overshoot (%)", "rise 10-90 % (s)", "error at the end (mm)"}};
  add_row(table, fmt::format("to {:g} m, predicted", experiment.setpoint_m), measured.began_at_s, prediction.step);
  if (experiment.disturbance_at_s < experiment.duration_s) {
    add_row(table, fmt::format("disturbance {:g} m, predicted", experiment.disturbance_m),
            measured.began_at_s + experiment.disturbance_at_s, prediction.disturbance);
  }
  for (const analysis::MeasuredStep& step : measured.steps) {
    add_row(table,
            fmt::format("{} {:.4g} to {:.4g} m, measured{}", text(step.cause), step.start_m, step.target_m,
                        step.is_from_outside ? " from outside" : ""),
            step.at_s, step.metrics, step.position_sd_m);
  }
  table.write(out);
  for (const analysis::MeasuredStep& step : measured.steps) {
    const std::string doubt = analysis::position_doubt(analysis::json_of(step));
    if (!doubt.empty()) fmt::print(out, "{} at {:.4g} s: {}\n", text(step.cause), step.at_s, doubt);
  }
  if (prediction.is_diverging) {
    fmt::print(out, "the predicted loop diverges: it is {:.3g} m off after {:.4g} s, where the prediction ends\n",
               prediction.measured_m.back(), prediction.time_s.back());
  }
  fmt::print(out, "predicted duty: clipped in {} % of the samples, sd at rest {}\n",
             fixed(100 * prediction.clipped_fraction, 2), cell(prediction.duty_sd_at_rest, 4));
}

void write_samples(std::ostream& out, const control::ClosedLoopPrediction& p) {
  write_csv(out, {{"t_s", p.time_s},
                  {"position_m", p.position_m},
                  {"velocity_m_s", p.velocity_m_s},
                  {"measured_m", p.measured_m},
                  {"duty", p.duty},
                  {"reference_m", p.reference_m}});
}

void add_world(CLI::App& command, control::ClosedLoopExperiment& e) {
  const auto add = [&command](const char* flag, auto& value, const char* meaning) {
    return command.add_option(flag, value, fmt::format("{} (default: {})", meaning, value));
  };
  add("--setpoint-m", e.setpoint_m, "The step")->check(finite());
  add("--duration-s", e.duration_s, "Length of the experiment")->check(positive());
  add("--disturbance-m", e.disturbance_m, "Offset of the measured position")->check(finite());
  add("--disturbance-at-s", e.disturbance_at_s, "When it begins; beyond the duration for none")->check(non_negative());
  add("--profile-velocity-m-s", e.profile_velocity_m_s, "Limit of the reference's velocity; 0 for a plain step")
      ->check(non_negative());
  add("--profile-acceleration-m-s2", e.profile_acceleration_m_s2, "Limit of the reference's acceleration")
      ->check(non_negative());
  add("--noise-sd-m", e.noise_sd_m, "White noise on the measured position")->check(non_negative());
  add("--seed", e.noise_seed, "Of the noise")->check(whole(0, kLargestSeed));
}

analysis::OrderedJson answer_of(const control::ClosedLoopExperiment& experiment, const Steering& steering,
                                const control::ClosedLoopPrediction& prediction, const Measured& measured,
                                const std::string& with) {
  analysis::OrderedJson answer = analysis::json_of(prediction);
  answer["experiment"] = {
      {"setpoint_m", experiment.setpoint_m},       {"duration_s", experiment.duration_s},
      {"disturbance_m", experiment.disturbance_m}, {"disturbance_at_s", experiment.disturbance_at_s},
      {"duty_min", experiment.duty_min},           {"duty_max", experiment.duty_max}};
  if (experiment.settling_band_m > 0) answer["experiment"]["settling_band_m"] = experiment.settling_band_m;
  answer["compared_with"] =
      measured.steps.empty() ? analysis::OrderedJson{} : analysis::OrderedJson(measured.position_source);
  answer["predicted_with"] = measured.steps.empty() ? analysis::OrderedJson{} : analysis::OrderedJson(with);
  const auto checksum_json = [](const std::optional<std::uint32_t>& checksum) {
    return checksum ? analysis::OrderedJson(*checksum) : analysis::OrderedJson{};
  };
  answer["controller_checksum"] = checksum_json(steering.checksum);
  answer["run_controller_checksum"] = checksum_json(measured.controller_checksum);
  answer["measured_steps"] = analysis::OrderedJson::array();
  for (const analysis::MeasuredStep& step : measured.steps)
    answer["measured_steps"].push_back(measured_step_json(step));
  answer["plant"] = analysis::json_of(experiment.plant);
  answer["sections"] = analysis::json_of(experiment.controller);
  answer["period_s"] = experiment.period_s;
  answer["method"] =
      steering.is_runs_own ? analysis::OrderedJson{} : analysis::OrderedJson(text(steering.controller.options.method));
  return answer;
}

}  // namespace

void add_options(CLI::App& command, Predict& options) {
  add_option(command, options.plant);
  add_option(command, options.controller);
  add_options(command, options.sampling);
  add_world(command, options.experiment);
  command
      .add_option("--duty-min", options.duty_min,
                  "Lowest duty; 0 for a motor without reverse (default: -1, with --run that of its controller)")
      ->check(from_to(-1, 1));
  command.add_option("--duty-max", options.duty_max, "Highest duty (default: 1, with --run that of its controller)")
      ->check(from_to(-1, 1));
  add_options(command, options.run);
  for (const char* flag : {"--setpoint-m", "--duration-s", "--disturbance-m", "--disturbance-at-s"}) {
    command.get_option("--run")->excludes(flag);
  }
  command.add_flag("--robustness", options.with_robustness, "Also for other gains, the other fluid, a one-way motor");
  add_json_and_csv_flags(command, options.form);
  command.footer(
      "With --run, the experiment is the run's first step of setpoint and the disturbance after it, with the "
      "controller\n"
      "that the robot had then unless --controller names another, and what the run did stands beside the prediction.\n"
      "Example: rheonaut predict --setpoint-m 0.1 --duration-s 40 --disturbance-m -0.05 --disturbance-at-s 20");
}

int run(const Predict& options, std::ostream& out) {
  control::ClosedLoopExperiment experiment = options.experiment;
  const Measured measured = options.run.run ? follow(options.run, experiment) : Measured{};
  const Steering steering = steering_of(options, measured);
  const std::string with = predicted_with(options, steering, measured);
  const Plant plant = read(options.plant);
  say_doubts(options.plant, plant);
  experiment.plant = plant.model;
  experiment.controller = steering.controller.sections;
  experiment.period_s = steering.controller.options.period_s;
  experiment.duty_min = steering.duty_min;
  experiment.duty_max = steering.duty_max;
  const control::ClosedLoopPrediction prediction = control::predict_closed_loop(experiment);
  if (options.form.is_csv) {
    write_samples(out, prediction);
  } else if (options.form.is_json) {
    analysis::OrderedJson answer = answer_of(experiment, steering, prediction, measured, with);
    if (options.with_robustness) {
      answer["robustness"] = analysis::json_of(control::robustness(experiment.plant, steering.controller));
    }
    write_json(out, answer);
  } else {
    write_table(out, experiment, prediction, measured, with);
    if (options.with_robustness) write_robustness(out, control::robustness(experiment.plant, steering.controller));
  }
  return 0;
}

}  // namespace server::cli
