// Puts conditions together from a test and two texts.
#include "tests/sim_robot/condition.hpp"

#include <array>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

constexpr double kFloatRoom = 1e-6;  // telemetry is in float

const char* text(LinkView link) {
  switch (link) {
    case LinkView::none: return "no link";
    case LinkView::up: return "link up";
    case LinkView::lost: return "link lost";
  }
  return "";
}

std::string mode_text(const View& view) {
  std::string mode = protocol::text(view.mode);
  if (view.sub_state != rheonaut_SUB_STATE_NONE) mode += std::string(" ") + protocol::text(view.sub_state);
  return mode;
}

const View& telemetry(const Moment& moment) {
  if (moment.received.is_truth)
    throw std::logic_error("a core does not show sub-state, setpoint and flags: ask telemetry");
  return moment.received;
}

std::string flag_texts(std::uint32_t flags) {
  constexpr std::array<const char*, 6> kNames{"backfill",     "saturated",      "link_loss",
                                              "sensor_fault", "position_limit", "lease_lapsed"};
  std::string texts;
  for (std::size_t bit = 0; bit < kNames.size(); ++bit) {
    if (flags & (1u << bit)) texts += (texts.empty() ? "" : " ") + std::string(kNames[bit]);
  }
  return texts.empty() ? "none" : texts;
}

Condition of_mode(const char* name, protocol::Mode mode) {
  return {name, [mode](const Moment& moment) { return moment.received.mode == mode; },
          [](const Moment& moment) { return "it is in " + mode_text(moment.received); }};
}

Condition of_sub_state(const char* name, protocol::SubState sub_state) {
  return {name, [sub_state](const Moment& moment) { return telemetry(moment).sub_state == sub_state; },
          [](const Moment& moment) { return "it is in " + mode_text(moment.received); }};
}

Condition of_motor(const char* name, bool is_on) {
  return {name, [is_on](const Moment& moment) { return (moment.received.duty != 0) == is_on; },
          [](const Moment& moment) { return "duty is " + short_text(moment.received.duty); }};
}

Condition of_link(LinkView link) {
  return {text(link), [link](const Moment& moment) { return moment.received.link == link; },
          [](const Moment& moment) { return text(moment.received.link); }};
}

std::string as_one(const std::string& text) {
  return text.find(" and ") != std::string::npos ? "(" + text + ")" : text;
}

std::string both(const std::string& left, const std::string& right) {
  return left == right ? left : left + ", " + right;
}

}  // namespace

Condition operator&&(const Condition& left, const Condition& right) {
  return {left.text_ + " and " + right.text_,
          [left, right](const Moment& moment) { return left.holds(moment) && right.holds(moment); },
          [left, right](const Moment& moment) {
            const bool left_holds = left.holds(moment), right_holds = right.holds(moment);
            if (left_holds && !right_holds) return right.account(moment);
            if (!left_holds && right_holds) return left.account(moment);
            return both(left.account(moment), right.account(moment));
          }};
}

Condition operator||(const Condition& left, const Condition& right) {
  return {"(" + left.text_ + " or " + right.text_ + ")",
          [left, right](const Moment& moment) { return left.holds(moment) || right.holds(moment); },
          [left, right](const Moment& moment) { return both(left.account(moment), right.account(moment)); }};
}

Condition operator!(const Condition& condition) {
  return {"not " + as_one(condition.text_), [condition](const Moment& moment) { return !condition.holds(moment); },
          [condition](const Moment& moment) { return condition.account(moment); }};
}

Condition Quantity::condition(const std::string& text, std::function<bool(double)> test) const {
  return {name_ + " " + text, [read = read_, test](const Moment& moment) { return test(read(moment)); },
          [quantity = *this](const Moment& moment) {
            return quantity.name_ + " is " + quantity.with_unit(quantity.read_(moment));
          }};
}

Quantity::Near Quantity::within(double tolerance) const { return {*this, tolerance}; }

Condition Quantity::Near::of(double value) const {
  return quantity_.condition(
      "within " + quantity_.with_unit(tolerance_) + " of " + quantity_.with_unit(value),
      [value, tolerance = tolerance_](double actual) { return std::abs(actual - value) <= tolerance; });
}

Condition Quantity::above(double bound) const {
  return condition("above " + with_unit(bound), [bound](double actual) { return actual > bound; });
}

Condition Quantity::below(double bound) const {
  return condition("below " + with_unit(bound), [bound](double actual) { return actual < bound; });
}

Condition Quantity::is(double value) const {
  return condition("is " + with_unit(value), [value](double actual) { return std::abs(actual - value) <= kFloatRoom; });
}

std::string Quantity::with_unit(double value) const {
  return std::isnan(value) || unit_.empty() ? short_text(value) : short_text(value) + " " + unit_;
}

inline namespace conditions {

Condition in_truth(const Condition& condition) {
  const auto turned = [](Moment moment) {
    moment.received = moment.truth;
    return moment;
  };
  return {"in truth " + as_one(condition.text()),
          [condition, turned](const Moment& moment) { return condition.holds(turned(moment)); },
          [condition, turned](const Moment& moment) { return "in truth " + condition.account(turned(moment)); }};
}

Quantity position() {
  return {"position", "m", [](const Moment& moment) { return moment.received.position_m; }};
}
Quantity velocity() {
  return {"velocity", "m/s", [](const Moment& moment) { return moment.received.velocity_m_s; }};
}
Quantity duty() {
  return {"duty", "", [](const Moment& moment) { return moment.received.duty; }};
}
Quantity impedance() {
  return {"impedance", "mV", [](const Moment& moment) { return moment.received.impedance_mv; }};
}
Quantity setpoint() {
  return {"setpoint", "m", [](const Moment& moment) { return telemetry(moment).setpoint_m.value_or(std::nan("")); }};
}
Quantity connections() {
  return {"connections", "", [](const Moment& moment) { return moment.connections; }};
}

Condition motor_on() { return of_motor("motor on", true); }
Condition motor_off() { return of_motor("motor off", false); }
Condition in_manual() { return of_mode("in manual", rheonaut_MODE_MANUAL); }
Condition in_auto() { return of_mode("in auto", rheonaut_MODE_AUTO); }
Condition in_emergency() { return of_mode("in emergency", rheonaut_MODE_EMERGENCY); }
Condition navigating() { return of_sub_state("navigating", rheonaut_SUB_STATE_NAVIGATING); }
Condition holding() { return of_sub_state("holding", rheonaut_SUB_STATE_HOLDING); }
Condition delivering() { return of_sub_state("delivering", rheonaut_SUB_STATE_DELIVERING); }
Condition link_up() { return of_link(LinkView::up); }
Condition link_lost() { return of_link(LinkView::lost); }

Condition flagged(rheonaut_TelemetryFlag flag) {
  return {"flagged " + flag_texts(flag), [flag](const Moment& moment) { return (telemetry(moment).flags & flag) != 0; },
          [](const Moment& moment) { return "flags are " + flag_texts(moment.received.flags); }};
}

Condition caught_up() {
  return {"caught up",
          [](const Moment& moment) { return moment.received.link == LinkView::up && moment.samples_owed == 0; },
          [](const Moment& moment) {
            return base::join_text(moment.samples_owed, " samples are owed, ", text(moment.received.link));
          }};
}

}  // namespace conditions

std::string text(const View& view) {
  std::string line = "position " + short_text(view.position_m) + " m, velocity " + short_text(view.velocity_m_s) +
                     " m/s, duty " + short_text(view.duty) + ", impedance " + short_text(view.impedance_mv) + " mV, ";
  if (view.setpoint_m) line += "setpoint " + short_text(*view.setpoint_m) + " m, ";
  return line + mode_text(view) + ", " + text(view.link);
}

std::string short_text(double value) {
  if (std::isnan(value)) return "none";
  std::ostringstream digits;
  digits.precision(4);
  digits << value;
  return digits.str();
}

}  // namespace sim_robot
