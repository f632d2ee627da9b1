// Reads the members one by one; what is left out has the defaults of the command line.
#include "server/api/bodies/tune_body.hpp"

#include <fmt/format.h>

#include "server/api/bodies/limits.hpp"

namespace server::api {
namespace {

using nlohmann::json;

Result<double> required_number(const Members& body, const char* name, Range<double> allowed) {
  const auto value = body.optional_number(name, allowed);
  if (!value) return std::unexpected{value.error()};
  if (*value) return **value;
  return fail(ErrorCode::bad_request, fmt::format("{} is missing", name), "missing_member");
}

Result<void> read_plant(const Members& body, Range<std::int64_t> ids, Range<std::size_t> fluid_bytes,
                        PlantOfJob& plant) {
  const int given = static_cast<int>(body.has("model_id")) + static_cast<int>(body.has("fluid")) +
                    static_cast<int>(body.has("plant"));
  if (given != 1) {
    return fail(ErrorCode::bad_request,
                fmt::format("give one of model_id, fluid and plant for the plant to tune for; {} are given", given),
                "missing_member");
  }
  if (body.has("model_id")) {
    const auto id = body.integer("model_id", ids);
    if (!id) return std::unexpected{id.error()};
    plant.model = *id;
  } else if (body.has("fluid")) {
    const auto fluid = body.text("fluid", fluid_bytes);
    if (!fluid) return std::unexpected{fluid.error()};
    plant.fluid = *fluid;
  } else {
    const auto model = analysis::model_from(body.object().at("plant"));
    if (!model) return std::unexpected{model.error()};
    const auto uncertainty = analysis::uncertainty_from(body.object().at("plant"));
    if (!uncertainty) return std::unexpected{uncertainty.error()};
    const auto doubts = analysis::doubts_from(body.object().at("plant"));
    if (!doubts) return std::unexpected{doubts.error()};
    plant.given = *model;
    plant.given_uncertainty = *uncertainty;
    plant.given_doubts = *doubts;
  }
  return {};
}

Result<void> read_loop(const Members& body, bool& is_velocity_loop) {
  const auto flag = body.flag("velocity_loop");
  if (!flag) return std::unexpected{flag.error()};
  is_velocity_loop = *flag;
  return {};
}

Result<void> read_specification(const Members& body, control::TuningSpec& spec) {
  const auto crossover = required_number(body, "crossover_rad_s", numbers("TuneJobBody.crossover_rad_s"));
  if (!crossover) return std::unexpected{crossover.error()};
  const auto margin = required_number(body, "phase_margin_deg", numbers("TuneJobBody.phase_margin_deg"));
  if (!margin) return std::unexpected{margin.error()};
  const auto mu = body.optional_number("mu", numbers("TuneJobBody.mu"));
  if (!mu) return std::unexpected{mu.error()};
  spec.gain_crossover_rad_s = *crossover;
  spec.phase_margin_deg = *margin;
  spec.mu = *mu;
  return {};
}

// Reads the limits of the robot that is to run the controller.
template <class Request>
Result<void> read_robot(const Members& body, Request& request) {
  const auto duty_min = body.optional_number("duty_min", numbers("TuneJobBody.duty_min"));
  if (!duty_min) return std::unexpected{duty_min.error()};
  const auto duty_max = body.optional_number("duty_max", numbers("TuneJobBody.duty_max"));
  if (!duty_max) return std::unexpected{duty_max.error()};
  const auto period_s = body.optional_number("period_s", numbers("TuneJobBody.period_s"));
  if (!period_s) return std::unexpected{period_s.error()};
  request.duty_min = *duty_min;
  request.duty_max = *duty_max;
  request.period_s = period_s->value_or(request.period_s);
  return {};
}

Result<void> read_range(const Members& body, control::TuningMapSpec& spec) {
  const auto from = body.optional_number("from_rad_s", numbers("TuningMapJobBody.from_rad_s"));
  if (!from) return std::unexpected{from.error()};
  const auto to = body.optional_number("to_rad_s", numbers("TuningMapJobBody.to_rad_s"));
  if (!to) return std::unexpected{to.error()};
  spec.from_rad_s = from->value_or(spec.from_rad_s);
  spec.to_rad_s = to->value_or(spec.to_rad_s);
  if (body.has("points")) {
    const auto points = body.integer("points", integers("TuningMapJobBody.points"));
    if (!points) return std::unexpected{points.error()};
    spec.points = static_cast<int>(*points);
  }
  if (spec.from_rad_s < spec.to_rad_s) return read_loop(body, spec.is_velocity_loop);
  return fail(ErrorCode::invalid,
              fmt::format("from_rad_s is {}, it must be below to_rad_s, which is {}", spec.from_rad_s, spec.to_rad_s),
              "out_of_range");
}

}  // namespace

Result<TuneBody> tune_body(const Members& body) {
  const auto known = body.only({"kind", "model_id", "fluid", "plant", "crossover_rad_s", "phase_margin_deg", "mu",
                                "velocity_loop", "duty_min", "duty_max", "period_s"});
  if (!known) return std::unexpected{known.error()};
  TuneBody parsed;
  auto read = read_plant(body, integers("TuneJobBody.model_id"), text_bytes("TuneJobBody.fluid"), parsed.plant);
  if (read) read = read_specification(body, parsed.request.spec);
  if (read) read = read_loop(body, parsed.request.spec.is_velocity_loop);
  if (read) read = read_robot(body, parsed.request);
  if (!read) return std::unexpected{read.error()};
  return parsed;
}

Result<analysis::MeasuredTuneRequest> tune_measured_body(const Members& body) {
  const auto known = body.only(
      {"kind", "run_id", "span", "crossover_rad_s", "phase_margin_deg", "mu", "duty_min", "duty_max", "period_s"});
  if (!known) return std::unexpected{known.error()};
  analysis::MeasuredTuneRequest request;
  const auto run = body.integer("run_id", integers("TuneMeasuredJobBody.run_id"));
  if (!run) return std::unexpected{run.error()};
  request.run = *run;
  if (body.has("span")) {
    const auto span = body.integer("span", integers("TuneMeasuredJobBody.span"));
    if (!span) return std::unexpected{span.error()};
    request.window.span = static_cast<std::uint32_t>(*span);
  }
  auto read = read_specification(body, request.spec);
  if (read) read = read_robot(body, request);
  if (!read) return std::unexpected{read.error()};
  return request;
}

Result<TuningMapBody> tuning_map_body(const Members& body) {
  const auto known =
      body.only({"kind", "model_id", "fluid", "plant", "from_rad_s", "to_rad_s", "points", "velocity_loop"});
  if (!known) return std::unexpected{known.error()};
  TuningMapBody parsed;
  auto read =
      read_plant(body, integers("TuningMapJobBody.model_id"), text_bytes("TuningMapJobBody.fluid"), parsed.plant);
  if (read) read = read_range(body, parsed.request.spec);
  if (!read) return std::unexpected{read.error()};
  return parsed;
}

}  // namespace server::api
