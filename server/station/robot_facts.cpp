// What is known of a robot otherwise than by what it sends: the fluid that it is in, whose model it has, and that
// it is retired.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>

#include "server/station/seat.hpp"

namespace server {

// SAFETY: a fluid brings its limits. While somebody is in control nobody else changes the limits that they command
// under.
Result<void> Station::set_fluid(const RobotId& id, const std::string& text, const Author& by) {
  const auto found = robots_.find(id);
  if (found == robots_.end()) {
    return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", id), "unknown_robot");
  }
  const auto listed = envelope_.listed(text);
  if (!listed) return std::unexpected{listed.error()};
  const std::string& fluid = *listed;
  RobotState& robot = found->second;
  if (robot.fluid == fluid) {
    // SAFETY: who may not command the robot sends it no model either.
    if (authority_.may_use(id, by.actor)) on_fluid_named_(robot, by);
    return {};
  }
  if (auto permitted = authority_.may_use(id, by.actor); !permitted) {
    permitted.error().detail += "; only who is in control changes the fluid";
    note_refusal(by, id, "fluid", nlohmann::json{{"fluid", fluid}}.dump(), permitted.error());
    return permitted;
  }
  AuditNote audit;
  audit.by = by;
  audit.robot_id = id;
  audit.action = "robot.fluid_set";
  audit.subject = fluid;
  audit.detail = audit_detail({{"before", robot.fluid}});
  // SAFETY: what waits was held to the limits of before, and outlives none that is narrower.
  const bool is_narrower = is_narrower_than(envelope_.in(fluid), envelope_.in(robot.fluid));
  robot.fluid = fluid;
  if (Seat& seat = seats_.at(id); is_narrower) {
    withdraw_queued(seat, "limits_changed", [](const PendingCommand&) { return true; });
    seat.drop_timed_because = "limits_changed";
    drop_timed(seat);
  }
  for (StationSink* sink : sinks_) sink->on_fluid(robot);
  for (StationSink* sink : sinks_) sink->on_audit(audit);
  note(robot, "fluid_set", fmt::format("{} by {}", fluid.empty() ? "not known" : fluid, by.actor));
  publish(robot);
  on_fluid_named_(robot, by);
  return {};
}

void Station::set_model(const RobotId& id, RobotModel model) {
  const auto found = robots_.find(id);
  if (found == robots_.end() || found->second.model == model) return;
  found->second.model = std::move(model);
  publish(found->second);
}

void Station::note_model(const RobotId& id, const char* kind, const std::string& detail) {
  if (const auto found = robots_.find(id); found != robots_.end()) note(found->second, kind, detail);
}

std::optional<float> Station::parameter_in_force(const RobotId& id, const std::string& name) const {
  const auto seat = seats_.find(id);
  return seat == seats_.end() ? std::nullopt : seat->second.settings.parameters.value(name);
}

const char* text(ModelState value) {
  switch (value) {
    case ModelState::assumed: return "assumed";
    case ModelState::sending: return "sending";
    case ModelState::confirmed: return "confirmed";
    case ModelState::failed: break;
  }
  return "failed";
}

// The configuration may have been changed since: a fluid that is no longer listed is not known.
void Station::restore_fluid(RobotState& robot, const std::string& fluid) const {
  robot.fluid = envelope_.is_listed(fluid) ? fluid : "";
  if (robot.fluid == fluid) return;
  spdlog::warn(
      "robot '{}' is in the fluid '{}', which the configuration does not list: the strictest limits of all fluids hold "
      "for it until its fluid is named",
      robot.id, fluid);
}

void Station::set_retired(const RobotId& id, std::int64_t retired_at_us, const std::string& actor) {
  const auto found = robots_.find(id);
  if (found == robots_.end() || found->second.retired_at_us == retired_at_us) return;
  RobotState& robot = found->second;
  const bool was_retired = robot.retired_at_us != 0;
  robot.retired_at_us = retired_at_us;
  if (was_retired && retired_at_us == 0) note(robot, "unretired", "by " + actor);
  if (!was_retired) note(robot, "retired", "by " + actor);
  publish(robot);
}

}  // namespace server
