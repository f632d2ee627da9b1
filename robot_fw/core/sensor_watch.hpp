// Detects sensor faults: readings that are missing, do not change, or lie outside the range.
//
//   missing       no reading in `missing_ticks` ticks in a row
//   stuck         `stuck_readings` in a row are equal; 0: not checked
//   out_of_range  `wrong_readings` in a row lie outside [min, max]
// A fault ends after 50 good readings in a row, or `stuck_readings` if that is more. A sensor without any reading yet
// is missing.
#pragma once

#include <cstdint>

namespace robot_fw {

enum class SensorFault : std::uint8_t { none, missing, stuck, out_of_range };

struct SensorRules {
  float min;
  float max;
  std::int16_t missing_ticks;
  std::int16_t stuck_readings;
  std::int16_t wrong_readings;
};

class SensorWatch {
 public:
  explicit SensorWatch(const SensorRules& rules) : rules_(rules) {}

  // Once per tick. True when a fault begins, ends or becomes another.
  bool step(float reading, bool is_valid);

  // Takes the sensor for missing until it has been good for long enough.
  void distrust() { fault_ = SensorFault::missing; }

  SensorFault fault() const { return fault_; }
  bool in_range(float reading) const { return reading >= rules_.min && reading <= rules_.max; }

 private:
  SensorFault found() const;

  SensorRules rules_;
  SensorFault fault_ = SensorFault::none;
  float last_ = 0;
  bool has_spoken_ = false;
  std::int16_t silent_ = 0, equal_ = 0, wrong_ = 0, good_ = 0;  // in a row
};

}  // namespace robot_fw
