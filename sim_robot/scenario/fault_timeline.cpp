// Begins and ends faults in the order of their times.
#include "sim_robot/scenario/fault_timeline.hpp"

#include <algorithm>

#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

// What is left of one that its target ends by itself and that begins late.
Fault late(Fault fault, std::uint64_t by_us) {
  constexpr double kLeastS = 0.001;
  if (ends_by_itself(fault.kind)) fault.for_s = std::max(kLeastS, fault.for_s - 1e-6 * static_cast<double>(by_us));
  return fault;
}

// Whether `next` takes the place of `old`. A robot that boots hangs no more.
bool replaces(const Fault& next, const Fault& old) {
  if (type_of(old.kind).target != type_of(next.kind).target) return false;
  return type_of(next.kind).lasts || next.kind == FaultKind::reboot;
}

}  // namespace

FaultTimeline::FaultTimeline(std::vector<TimedFault> faults, Log log)
    : to_come_(std::move(faults)), log_(std::move(log)) {}

void FaultTimeline::advance(const FaultyRobot& robot, std::uint64_t true_us) {
  now_us_ = true_us;
  RobotLife& life = robot.life;
  const bool is_late = true_us > life.true_us() + SimulatedRobot::kMaxLatenessUs;
  if (is_late) life.advance_to(true_us);  // which skips ticks; what was due meanwhile comes behind them
  while (next_us() <= true_us) {
    const std::uint64_t at_us = next_us();
    if (at_us > life.true_us()) life.advance_to(at_us - 1);
    apply_until(robot, at_us);
  }
  life.advance_to(true_us);
}

std::uint64_t FaultTimeline::inject(const Fault& fault, const FaultyRobot& robot) {
  return begin(fault, robot, now_us_);
}

bool FaultTimeline::withdraw(std::uint64_t id, const FaultyRobot& robot) {
  const auto found = std::ranges::find(in_force_, id, &FaultInForce::id);
  if (found == in_force_.end()) return false;
  end(found->fault, robot);
  say(now_us_, std::string(type_of(found->fault.kind).name) + " is withdrawn");
  in_force_.erase(found);
  return true;
}

std::uint64_t FaultTimeline::next_end_us() const {
  std::uint64_t next = kNever;
  for (const FaultInForce& each : in_force_) next = std::min(next, each.until_us);
  return next;
}

std::uint64_t FaultTimeline::next_start_us() const {
  return next_ < to_come_.size() ? microseconds(to_come_[next_].at_s) : kNever;
}

std::uint64_t FaultTimeline::next_us() const { return std::min(next_end_us(), next_start_us()); }

void FaultTimeline::apply_until(const FaultyRobot& robot, std::uint64_t now_us) {
  while (next_us() <= now_us && next_us() != kNever) {
    const std::uint64_t at_us = next_us();
    end_due(robot, at_us);
    if (next_start_us() != at_us) continue;
    const Fault& fault = to_come_[next_++].fault;
    if (const std::string reason = why_not(fault.kind, robot.link != nullptr); !reason.empty()) {
      ++passed_over_;
      say(at_us, reason);
      continue;
    }
    begin(fault, robot, at_us);
  }
}

void FaultTimeline::end_due(const FaultyRobot& robot, std::uint64_t at_us) {
  for (const FaultInForce& each : in_force_) {
    if (each.until_us > at_us) continue;
    if (!ends_by_itself(each.fault.kind)) end(each.fault, robot);
    say(at_us, std::string(type_of(each.fault.kind).name) + " is over");
  }
  std::erase_if(in_force_, [at_us](const FaultInForce& each) { return each.until_us <= at_us; });
}

std::uint64_t FaultTimeline::begin(const Fault& fault, const FaultyRobot& robot, std::uint64_t at_us) {
  check(fault, robot);  // before anything ends
  end_replaced(fault, robot);
  const std::uint64_t true_us = robot.life.true_us();
  apply(late(fault, true_us - std::min(at_us, true_us)), robot);
  const FaultType& type = type_of(fault.kind);
  say(at_us, type.name);
  ++last_id_;
  if (!type.lasts) return last_id_;
  in_force_.push_back({last_id_, fault, at_us, end_us(at_us, fault.for_s)});
  return last_id_;
}

// An outage that follows an outage lets nothing through in between.
void FaultTimeline::end_replaced(const Fault& next, const FaultyRobot& robot) {
  std::erase_if(in_force_, [&](const FaultInForce& each) {
    const bool is_replaced = replaces(next, each.fault);
    const bool goes_on = next.kind == FaultKind::link_outage && each.fault.kind == FaultKind::link_outage;
    if (is_replaced && !goes_on) end(each.fault, robot);
    return is_replaced;
  });
}

void FaultTimeline::say(std::uint64_t at_us, const std::string& what) const {
  if (log_) log_(base::join_text("at ", static_cast<double>(at_us) * 1e-6, " s: ", what));
}

}  // namespace sim_robot
