// The board support: connects the core to the clock, the sensors, the motor, the link and the flash.
//
// begin() once, then step() for ever. Owns everything; one instance, since the motor's interrupt has no owner, and in
// static storage: it holds the core with its ring, 22 kB. 7.7 kB more of the ring lie in instruction RAM; where
// there is none, no robot is made, the motor stays off and the LED says "refused".
#pragma once

#include <array>
#include <optional>

#include "robot_fw/core/robot.hpp"
#include "robot_fw/esp8266/analogue_inputs.hpp"
#include "robot_fw/esp8266/bno055.hpp"
#include "robot_fw/esp8266/flash_storage.hpp"
#include "robot_fw/esp8266/latch_memory.hpp"
#include "robot_fw/esp8266/motor.hpp"
#include "robot_fw/esp8266/station_link.hpp"
#include "robot_fw/esp8266/status_led.hpp"
#include "robot_fw/esp8266/tick_schedule.hpp"
#include "robot_fw/esp8266/wide_clock.hpp"

namespace robot_fw::esp8266 {

constexpr std::uint32_t kTickUs = 10'000;

class Board {
 public:
  explicit Board(const Secrets& secrets, const Settings& settings = kSettings);

  void begin();
  void step();

  bool has_robot() const { return robot_.has_value(); }  // from begin() on, when it found the memory
  const Robot& robot() const { return *robot_; }
  const StationLink& link() const { return link_; }
  const Motor& motor() const { return motor_; }
  LedPattern led_pattern() const;

 private:
  void tick();
  Inputs read_inputs(std::uint64_t robot_time_us);
  bool receive();  // says whether anything came
  void transmit();
  void close_when_dead();
  void use_rest();
  void keep_latch();
  void close_link();

  const Secrets& secrets_;
  Motor motor_;
  WideClock clock_;
  TickSchedule ticks_{kTickUs};
  Bno055 imu_;
  AnalogueInputs analogue_;
  const std::int8_t motor_supply_pin_;
  StatusLed led_;
  LatchMemory latch_;
  FlashStorage storage_{motor_};
  StationLink link_;
  std::optional<Robot> robot_;                                   // see has_robot()
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes_{};  // just read, or about to be written
  std::uint32_t tick_us_ = 0;
};

}  // namespace robot_fw::esp8266
