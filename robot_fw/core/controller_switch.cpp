// Warms up, cross-fades, turns back.
#include "robot_fw/core/controller_switch.hpp"

#include <utility>

namespace robot_fw {

bool ControllerSwitch::set(const ControllerSections& sections, bool moving) {
  if (changing() && !warming_up()) return false;
  if (!changing()) former_ = newest_;
  newest_ = Controller{sections};
  has_former_ = true;
  ticks_ = moving ? 0 : kDone;
  if (!moving) news_ = true;
  return true;
}

bool ControllerSwitch::restore(bool moving) {
  if (!has_former_) return false;
  std::swap(newest_, former_);
  news_ = true;
  if (warming_up()) {
    ticks_ = kDone;  // it has had the motor all along
  } else if (changing()) {
    ticks_ = kDone - (ticks_ - kWarmUpTicks);  // the same weights the other way round
  } else {
    newest_.reset();
    ticks_ = moving ? 0 : kDone;
    news_ = !moving;
  }
  return true;
}

ControllerDuty ControllerSwitch::step(float error_m, float position_m) {
  const ControllerDuty newest = newest_.step(error_m, position_m);
  if (!changing()) return newest;
  const ControllerDuty former = former_.step(error_m, position_m);
  ++ticks_;
  if (warming_up()) return former;
  if (ticks_ == kWarmUpTicks + 1) news_ = true;
  const float weight = static_cast<float>(ticks_ - kWarmUpTicks) / static_cast<float>(kFadeTicks);
  return {former.asked + weight * (newest.asked - former.asked),
          former.limited + weight * (newest.limited - former.limited)};
}

void ControllerSwitch::reset() {
  if (warming_up()) news_ = true;
  ticks_ = kDone;
  newest_.reset();
  former_.reset();
}

bool ControllerSwitch::take_news() { return std::exchange(news_, false); }

void ControllerSwitch::add_to(Crc32& crc) const {
  newest_.add_to(crc);
  former_.add_to(crc);
}

}  // namespace robot_fw
