// Boot, tick, and what happens between two ticks.
#include "robot_fw/esp8266/board.hpp"

#include <Arduino.h>
#include <core_version.h>
#include <user_interface.h>

#include "robot_fw/esp8266/instruction_ram.hpp"
#include "robot_fw/esp8266/reset_cause.hpp"

// SAFETY: that no write waits and that the dead-man interrupt runs was read in the source of this version alone.
static_assert(
    ARDUINO_ESP8266_MAJOR == 3 && ARDUINO_ESP8266_MINOR == 1 && ARDUINO_ESP8266_REVISION == 2,
    "made for Arduino core 3.1.2 (docs/hardware.md, Flashing); read TlsStream and Motor beside another one first");

namespace robot_fw::esp8266 {
namespace {

constexpr char kFirmwareVersion[] = "0.9.0-esp8266";
constexpr std::size_t kPieceBytes = 512;  // read in one turn

// From the hardware's generator, which is only random while the radio is on.
std::uint64_t random_boot_id() {
  std::uint64_t boot_id = 0;
  while (boot_id == 0) boot_id = static_cast<std::uint64_t>(ESP.random()) << 32 | ESP.random();
  return boot_id;
}

// The samples of the ring that lie in instruction RAM; says whether there is room for them.
bool place_samples() {
  void* const memory = instruction_ram(kSamplesElsewhere * sizeof(Sample));
  TelemetryRing::set_memory_elsewhere(static_cast<Sample*>(memory));
  return memory != nullptr;
}

}  // namespace

Board::Board(const Secrets& secrets, const Settings& settings)
    : secrets_(secrets),
      motor_(settings.motor),
      imu_(settings.imu),
      analogue_(settings.analogue),
      motor_supply_pin_(settings.motor_supply.sense_pin),
      led_(settings.led),
      link_(secrets, clock_) {}

void Board::begin() {
  motor_.begin();  // SAFETY: first of all
  led_.begin();
  // SAFETY: without memory there is no robot: no tick completes, so nothing ever raises the motor's pin.
  if (!place_samples()) return;
  analogue_.begin();
  if (motor_supply_pin_ != kNoPin) pinMode(static_cast<std::uint8_t>(motor_supply_pin_), INPUT_PULLUP);
  latch_.begin();
  storage_.begin();
  link_.begin();
  RobotConfig config;
  config.robot_id = secrets_.robot_id;
  config.token = secrets_.token;
  config.firmware_version = kFirmwareVersion;
  config.boot_id = random_boot_id();
  config.reset_cause = reset_cause(ESP.getResetInfoPtr()->reason, latch_.kept());
  config.duty_min = motor_.duty_min();
  config.sample_period_us = kTickUs;
  config.restored_emergency_id = latch_.emergency_id();
  config.restored_emergency_cause = latch_.cause();
  config.storage = &storage_;
  robot_.emplace(config);
  keep_latch();
  ESP.wdtEnable(0U);  // its time, 3.2 s, is fixed; a second one in hardware bites after 8 s
  imu_.begin(clock_.now_us());
  ticks_.begin(clock_.now_us());
}

void Board::step() {
  if (!robot_) {
    led_.show(led_pattern(), clock_.now_us());
    return;
  }
  if (ticks_.due(clock_.now_us())) tick();
  const bool received = receive();
  transmit();
  if (!received) close_when_dead();
  use_rest();
  led_.show(led_pattern(), clock_.now_us());
}

// Sensors, core, motor: nothing in here waits for the network or the flash.
void Board::tick() {
  const std::uint64_t began_us = clock_.now_us();
  const Inputs inputs = read_inputs(ticks_.take(began_us));
  robot_->step(inputs, kTickUs * 1e-6F);
  motor_.complete_tick(robot_->duty());
  keep_latch();
  ESP.wdtFeed();
  tick_us_ = static_cast<std::uint32_t>(clock_.now_us() - began_us);
}

Inputs Board::read_inputs(std::uint64_t robot_time_us) {
  const Bno055::Reading reading = imu_.read(robot_time_us);
  analogue_.read();
  Inputs inputs;
  inputs.robot_time_us = robot_time_us;
  inputs.acceleration_counts = reading.acceleration_counts;
  inputs.acceleration_is_valid = reading.is_valid;
  inputs.imu_calibration = reading.calibration;
  inputs.impedance_mv = analogue_.impedance_mv();
  inputs.supply_mv = analogue_.supply_mv();
  inputs.motor_supply_is_cut =
      motor_supply_pin_ != kNoPin && digitalRead(static_cast<std::uint8_t>(motor_supply_pin_)) == HIGH;
  inputs.rssi_dbm = link_.rssi_dbm();
  inputs.free_memory_bytes = ESP.getFreeHeap();
  inputs.tick_us = tick_us_;
  inputs.missed_ticks = ticks_.missed();
  return inputs;
}

// At most one piece a turn, so that a flood from the network delays no tick.
bool Board::receive() {
  const std::size_t size = link_.read(bytes_.data(), kPieceBytes);
  if (size == 0) return false;
  const bool keep = robot_->receive({bytes_.data(), size}, clock_.now_us());
  motor_.follow(robot_->duty());  // SAFETY: a stop acts now, not with the next tick
  keep_latch();
  if (robot_->link_up()) link_.welcomed();
  if (!keep) close_link();
  return true;
}

void Board::transmit() {
  const std::size_t room = link_.room();
  if (room == 0) return;
  // SAFETY: only what TCP takes at once; a frame that does not fit stays with the core.
  const std::size_t capacity = room < bytes_.size() ? room : bytes_.size();
  const std::size_t size = robot_->transmit(bytes_.data(), capacity, clock_.now_us());
  if (size > 0 && !link_.write({bytes_.data(), size})) close_link();
}

// SAFETY: only when nothing came in this turn; after a stall the silence may be the robot's own, and a stop that waited
// is read before the verdict.
void Board::close_when_dead() {
  if (link_.state() != StationLink::State::open) return;
  if (!link_.alive() || robot_->connection_is_silent(clock_.now_us())) close_link();
}

// What may block, for seconds.
void Board::use_rest() {
  const bool at_rest = robot_->at_rest() && motor_.is_off();
  if (at_rest && !storage_.write_pending()) robot_->storage_failed();
  const bool was_open = link_.state() == StationLink::State::open;
  const bool ring_has_room = robot_->samples().fill() < TelemetryRing::kCapacity;
  if (link_.step(at_rest, ring_has_room)) {
    robot_->link_opened(clock_.now_us());
  } else if (was_open && link_.state() != StationLink::State::open) {
    robot_->link_closed(clock_.now_us());
  }
}

void Board::keep_latch() { latch_.keep(robot_->emergency_id(), robot_->emergency_cause()); }

void Board::close_link() {
  link_.close();
  robot_->link_closed(clock_.now_us());
}

LedPattern Board::led_pattern() const {
  if (!robot_) return LedPattern::refused;
  if (robot_->emergency_id() != 0) return LedPattern::emergency;
  if (robot_->link_up()) return LedPattern::connected;
  const bool refused = robot_->refusal() != rheonaut_REFUSAL_REASON_NONE || !link_.key_is_sound();
  return refused ? LedPattern::refused : LedPattern::connecting;
}

}  // namespace robot_fw::esp8266
