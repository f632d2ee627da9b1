// The emergency latch, and the last word on the duty.
//
// Each stop gives the latch a new id, so that a clear, which names an id, can never undo a later stop.
#pragma once

#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw {

struct DutyRange {
  float min = -1;  // in [-1, 0]
  float max = 1;   // in (0, 1]

  bool contains(float duty) const { return duty >= min && duty <= max; }  // false for NaN
};

class Safety {
 public:
  Safety(DutyRange range, std::uint64_t boot_id);

  // Latches under a new id, also when latched already.
  void latch(protocol::EmergencyCause cause);
  // Takes over a latch that outlived a reset.
  void restore(std::uint64_t emergency_id, protocol::EmergencyCause cause);
  // Unlatches if `emergency_id` is the one in force; says whether it did.
  bool clear(std::uint64_t emergency_id);

  bool latched() const { return emergency_id_ != 0; }
  std::uint64_t emergency_id() const { return emergency_id_; }
  protocol::EmergencyCause cause() const { return cause_; }
  const DutyRange& range() const { return range_; }

  // What the motor gets of the duty wanted: 0 when latched or not finite, otherwise within the range.
  float permit(float wanted_duty) const;

 private:
  DutyRange range_;
  std::uint64_t boot_id_;
  std::uint64_t stops_ = 0;
  std::uint64_t emergency_id_ = 0;
  protocol::EmergencyCause cause_ = rheonaut_EMERGENCY_CAUSE_NONE;
};

}  // namespace robot_fw
