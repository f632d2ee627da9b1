// Conditions on what is known of a robot, which read like sentences and say themselves what they are.
//
//   position().within(0.005).of(0.1) and not motor_on()
//   in_truth(motor_off())
// They speak of what the station has received; in_truth() asks the robot and its world instead. Words of auto's
// sub-state, of setpoint and flags have no truth but what is received: in_truth() of them throws std::logic_error.
#pragma once

#include <functional>
#include <string>

#include "sim_robot/lab/moment.hpp"

namespace sim_robot {

class Condition {
 public:
  using Test = std::function<bool(const Moment&)>;
  using Account = std::function<std::string(const Moment&)>;

  // `account` says what is the case, whether it holds or not.
  Condition(std::string text, Test test, Account account)
      : text_(std::move(text)), test_(std::move(test)), account_(std::move(account)) {}

  bool holds(const Moment& moment) const { return test_(moment); }
  const std::string& text() const { return text_; }
  // "position is 0.07 m"; of conditions that are composed, the parts to blame.
  std::string account(const Moment& moment) const { return account_(moment); }

  friend Condition operator&&(const Condition& left, const Condition& right);
  friend Condition operator||(const Condition& left, const Condition& right);
  friend Condition operator!(const Condition& condition);

 private:
  std::string text_;
  Test test_;
  Account account_;
};

class Quantity {
 public:
  using Read = std::function<double(const Moment&)>;

  class Near;

  Quantity(std::string name, std::string unit, Read read)
      : name_(std::move(name)), unit_(std::move(unit)), read_(std::move(read)) {}

  Near within(double tolerance) const;  // .of(value), bounds included
  Condition above(double bound) const;
  Condition below(double bound) const;
  Condition is(double value) const;  // as far as a float can

 private:
  Condition condition(const std::string& text, std::function<bool(double)> test) const;
  std::string with_unit(double value) const;

  std::string name_, unit_;
  Read read_;
};

class Quantity::Near {
 public:
  Near(Quantity quantity, double tolerance) : quantity_(std::move(quantity)), tolerance_(tolerance) {}
  Condition of(double value) const;

 private:
  Quantity quantity_;
  double tolerance_;
};

inline namespace conditions {

Condition in_truth(const Condition& condition);

Quantity position();   // m
Quantity velocity();   // m/s
Quantity duty();       // in [-1, 1]
Quantity impedance();  // mV
Quantity setpoint();   // m; not a number without one
Quantity connections();

Condition motor_on();
Condition motor_off();  // duty is 0
Condition in_manual();
Condition in_auto();
Condition in_emergency();
Condition navigating();  // and so in auto
Condition holding();
Condition delivering();
Condition link_up();
Condition link_lost();  // by its own time-out, whatever the connection says
Condition flagged(rheonaut_TelemetryFlag flag);
Condition caught_up();  // the link is up and nothing is owed of what was made meanwhile

}  // namespace conditions

// "position 0.07 m, velocity 0.001 m/s, duty 0.31, …"
std::string text(const View& view);
// At most four digits that count.
std::string short_text(double value);

}  // namespace sim_robot
