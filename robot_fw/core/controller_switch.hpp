// The controller in force, the one before it, and the change between them.
//
//   at rest   the new one is in force at once
//   in auto   it runs on the same error beside the old one for 1 s, then the duty passes from the old one to the new
//             one over 0.2 s; it is in force from the first tick of that cross-fade on
// A reset (motion ends, or auto starts) ends a change at once.
#pragma once

#include "robot_fw/core/controller.hpp"

namespace robot_fw {

class ControllerSwitch {
 public:
  static constexpr std::uint32_t kWarmUpTicks = 100;
  static constexpr std::uint32_t kFadeTicks = 20;

  explicit ControllerSwitch(const ControllerSections& first) : newest_(first), former_(first) {}

  // Begins the change to a new controller; it replaces one not yet in force. False during a cross-fade.
  bool set(const ControllerSections& sections, bool moving);
  // Changes back to the one before. A change under way reverses without a jump. False if there is none.
  bool restore(bool moving);

  ControllerDuty step(float error_m, float position_m);
  void reset();
  void add_to(Crc32& crc) const;  // its state

  const ControllerSections& in_force() const { return (warming_up() ? former_ : newest_).sections(); }
  // Whether another controller has come into force since the last call.
  bool take_news();

 private:
  static constexpr std::uint32_t kDone = kWarmUpTicks + kFadeTicks;

  bool changing() const { return ticks_ < kDone; }
  bool warming_up() const { return ticks_ <= kWarmUpTicks && changing(); }

  Controller newest_;
  Controller former_;
  bool has_former_ = false;
  bool news_ = false;
  std::uint32_t ticks_ = kDone;  // since the change began
};

}  // namespace robot_fw
