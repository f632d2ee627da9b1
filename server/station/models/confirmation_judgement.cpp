#include "server/station/models/confirmation_judgement.hpp"

#include "server/station/models/parameter_match.hpp"

namespace server::station {
namespace {

// A confirmation that did not come from here.
Judgement judge_origin(const ObservedConfirmation& seen, const ParameterTable& reported, const FluidModel* model,
                       std::int64_t now_us) {
  if (model != nullptr && holds(reported, *model)) return {Finding::model_of_fluid, false};
  if (seen.was_seen_to_rise()) return {Finding::by_command, false};
  const bool is_reported = reported.value(kModelConfirmed).has_value();
  if (model != nullptr && !is_reported && seen.is_new(now_us)) return {Finding::nothing_new, true};
  return {Finding::of_unknown_origin, true};
}

}  // namespace

Judgement judge(const RobotState& robot, const ObservedConfirmation& seen, const ParameterTable& reported,
                const std::optional<FluidModel>& sent, const FluidModel* model, std::int64_t now_us) {
  const bool flag = seen.flag().value_or(false);
  const bool is_held_for_confirmed = robot.model.state == ModelState::confirmed;
  const bool is_another = is_held_for_confirmed && !robot.model.fluid.empty() && sent && holds_another(reported, *sent);
  const bool is_flag_old = seen.is_older_than_page(robot.next_seq, now_us);
  if (is_held_for_confirmed && (!flag || (is_another && is_flag_old))) return {Finding::taken_back, is_flag_old};
  if (flag && !is_flag_old && (!is_held_for_confirmed || is_another)) {
    return judge_origin(seen, reported, model, now_us);
  }
  return {Finding::nothing_new, is_flag_old};
}

}  // namespace server::station
