// How time passes on the chip, and the functions of the Arduino core that the robot calls.
#include "chip.hpp"

#include <algorithm>
#include <cstring>

#include "Arduino.h"
#include "ESP8266WiFi.h"
#include "WiFiClientSecure.h"
#include "Wire.h"
#include "core_esp8266_waveform.h"
#include "flash_hal.h"
#include "user_interface.h"

EspClass ESP;
TwoWire Wire;
WiFiClass WiFi;
SetRegister GPOS{true};
SetRegister GPOC{false};

void Chip::pass(std::uint64_t us) {
  const std::uint64_t until_us = now_us + us;
  for (;;) {
    const bool fires = timer != nullptr && timer_at_us <= until_us;
    const std::uint64_t next_us = fires ? std::max(timer_at_us, now_us) : until_us;
    for (std::size_t i = 0; i < pins.size(); ++i) {
      if (level(static_cast<int>(i))) pins[i].high_us += next_us - now_us;
    }
    now_us = next_us;
    if (!fires) return;
    const std::uint64_t cycles = timer();
    timer_at_us = now_us + std::clamp<std::uint64_t>(cycles / kCyclesPerUs, 1, 10'000);
  }
}

void Chip::blocks(std::uint64_t us) {
  if (before_blocking) before_blocking();
  pass(us);
}

void Chip::write_latch(std::uint32_t mask, bool high) {
  for (std::size_t i = 0; i < 16; ++i) {
    if ((mask >> i & 1U) != 0) pins[i].latch = high;
  }
}

void Chip::reset(std::uint32_t reason) {
  timer = nullptr;
  now_us = 0;
  for (Pin& pin : pins) pin.output = false, pin.high_us = 0;
  wifi_begun = false;
  socket = Socket{};
  power_lost = false;
  power_cut_after_bytes = -1;
  reset_reason = reason;
  before_blocking = nullptr;
}

void Chip::power_cycle() {
  reset(REASON_DEFAULT_RST);
  for (std::uint32_t& word : rtc_memory) word = ESP.random();
  for (std::uint32_t& word : instruction_ram) word = ESP.random();
}

SetRegister& SetRegister::operator=(std::uint32_t mask) {
  chip.write_latch(mask, high_);
  return *this;
}

unsigned long micros() { return static_cast<std::uint32_t>(chip.counter_us + chip.now_us); }
std::uint32_t esp_get_cycle_count() { return static_cast<std::uint32_t>(chip.now_us * kCyclesPerUs); }
void pinMode(std::uint8_t pin, std::uint8_t mode) {
  chip.pins[pin].output = mode == OUTPUT;
  if (chip.level(pin)) ++chip.pins[pin].rises;
}
void digitalWrite(std::uint8_t pin, std::uint8_t level) { chip.pins[pin].latch = level != LOW; }
int digitalRead(std::uint8_t pin) { return chip.pins[pin].driven_high ? HIGH : LOW; }
int analogRead(std::uint8_t) {
  const bool supply = chip.supply_pin >= 0 && chip.level(chip.supply_pin);
  return supply ? chip.analogue_with_supply : chip.analogue;
}
void setTimer1Callback(std::uint32_t (*function)()) {
  chip.timer = function;
  chip.timer_at_us = chip.now_us;
}

std::uint32_t EspClass::random() { return chip.random_state = chip.random_state * 1664525U + 1013904223U; }
std::uint32_t EspClass::getFreeHeap() { return 20'000; }
void EspClass::wdtEnable(std::uint32_t) { ++chip.watchdog_enables; }
void EspClass::wdtFeed() { ++chip.watchdog_feeds; }
rst_info* EspClass::getResetInfoPtr() {
  static rst_info reset_info;
  reset_info.reason = chip.reset_reason;
  return &reset_info;
}
bool EspClass::rtcUserMemoryRead(std::uint32_t offset, std::uint32_t* words, std::size_t size) {
  if (offset * 4 + size > sizeof(chip.rtc_memory)) return false;
  std::memcpy(words, chip.rtc_memory.data() + offset, size);
  return true;
}
bool EspClass::rtcUserMemoryWrite(std::uint32_t offset, std::uint32_t* words, std::size_t size) {
  if (offset * 4 + size > sizeof(chip.rtc_memory)) return false;
  std::memcpy(chip.rtc_memory.data() + offset, words, size);
  return true;
}
bool EspClass::flashEraseSector(std::uint32_t sector) {
  if (chip.power_lost) return false;
  chip.blocks(chip.erase_takes_us);
  ++chip.flash_erases;
  const std::uint32_t from = sector * kFlashSectorBytes - FS_PHYS_ADDR;
  std::fill_n(chip.flash.begin() + from, kFlashSectorBytes, std::uint8_t{0xFF});
  return true;
}
bool EspClass::flashWrite(std::uint32_t address, std::uint32_t* words, std::size_t size) {
  if (chip.power_lost) return false;
  ++chip.flash_writes;
  if (chip.power_cut_after_bytes >= 0) {
    size = static_cast<std::size_t>(chip.power_cut_after_bytes);
    chip.power_lost = true;
  }
  // Flash can only clear bits.
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(words);
  for (std::size_t i = 0; i < size; ++i) chip.flash[address - FS_PHYS_ADDR + i] &= bytes[i];
  return !chip.power_lost;
}
bool EspClass::flashRead(std::uint32_t address, std::uint32_t* words, std::size_t size) {
  if (chip.power_lost) return false;
  std::memcpy(words, chip.flash.data() + (address - FS_PHYS_ADDR), size);
  return true;
}

void TwoWire::begin(int, int) { ++chip.bus_starts; }
void TwoWire::setClock(std::uint32_t) {}
void TwoWire::setClockStretchLimit(std::uint32_t) {}
std::uint8_t TwoWire::status() {
  chip.imu_holds_data_line = false;
  return 0;
}
void TwoWire::beginTransmission(std::uint8_t address) {
  address_ = address;
  written_.clear();
}
std::size_t TwoWire::write(std::uint8_t byte) {
  written_.push_back(byte);
  return 1;
}
std::uint8_t TwoWire::endTransmission(std::uint8_t) {
  if (chip.imu_holds_data_line) return 4;
  if (!chip.imu_there || address_ != 0x28) return 2;
  register_ = written_.at(0);
  for (std::size_t i = 1; i < written_.size(); ++i) chip.imu_registers.at(register_ + i - 1) = written_[i];
  return 0;
}
std::uint8_t TwoWire::requestFrom(std::uint8_t address, std::uint8_t count) {
  chip.pass(chip.imu_read_takes_us);
  if (!chip.imu_there || chip.imu_holds_data_line || address != 0x28) return 0;
  if (chip.imu_reads_to_fail > 0) return --chip.imu_reads_to_fail, 0;
  return count;
}
int TwoWire::read() { return chip.imu_registers.at(register_++); }

void WiFiClass::persistent(bool on) { chip.wifi_persistent = on; }
void WiFiClass::setAutoReconnect(bool on) { chip.wifi_reconnects = on; }
void WiFiClass::mode(WiFiMode_t) {}
void WiFiClass::setSleepMode(WiFiSleepType_t type) { chip.wifi_sleeps = type != WIFI_NONE_SLEEP; }
void WiFiClass::begin(const char*, const char*) {
  if (chip.before_blocking) chip.before_blocking();
  chip.wifi_begun = true;
  chip.joined_at_us = chip.now_us + chip.join_takes_us;
  ++chip.joins;
}
wl_status_t WiFiClass::status() { return chip.wifi_joined() ? WL_CONNECTED : WL_DISCONNECTED; }
std::int32_t WiFiClass::RSSI() { return -60; }
int WiFiClass::hostByName(const char*, IPAddress&, std::uint32_t timeout_ms) {
  chip.socket.attempt_began_us.push_back(chip.now_us);
  if (!chip.socket.knows_name) {
    chip.blocks(timeout_ms * 1000);
    chip.socket.attempt_failed_us.push_back(chip.now_us);
  }
  return chip.socket.knows_name;
}

int WiFiClient::connect(IPAddress, std::uint16_t) {
  ++chip.socket.dials;
  chip.blocks(chip.socket.answers ? 0 : chip.socket.timeout_ms * 1000);
  const bool is_there = chip.socket.answers && !chip.socket.refuses;
  if (!is_there) chip.socket.attempt_failed_us.push_back(chip.now_us);
  return is_there;
}

int WiFiClient::availableForWrite() { return static_cast<int>(chip.socket.room); }
void WiFiClient::setTimeout(unsigned long timeout_ms) { chip.socket.timeout_ms = timeout_ms; }
std::size_t WiFiClient::write_some(std::size_t size) {
  const std::size_t taken = chip.socket.takes ? std::min(size, chip.socket.room) : 0;
  if (!chip.socket.acknowledges) chip.socket.room -= taken;
  if (taken < size) chip.blocks(2 * chip.socket.timeout_ms * 1000);
  return taken;
}

namespace BearSSL {

bool WiFiClientSecureCtx::run_engine(bool may_wait) {
  std::size_t size = chip.socket.sealed;
  if (!may_wait) size = std::min(size, chip.socket.room);
  if (size > 0) chip.socket.sealed -= write_some(size);
  return chip.socket.sealed == 0;
}
bool WiFiClientSecureCtx::_connectSSL(const char*) {
  const std::uint64_t limit_us = chip.socket.timeout_ms * 1000;
  chip.blocks(std::min(chip.socket.handshake_takes_us, limit_us));
  chip.socket.connected = chip.socket.handshake_takes_us <= limit_us;
  if (!chip.socket.connected) chip.socket.attempt_failed_us.push_back(chip.now_us);
  return chip.socket.connected;
}
std::uint8_t WiFiClientSecureCtx::connected() { return available() > 0 || chip.socket.connected; }
int WiFiClientSecureCtx::available() {
  if (!chip.socket.input_is_found) {
    if (!run_engine(false)) return 0;
    chip.socket.input_is_found = !chip.socket.incoming.empty();
  }
  return static_cast<int>(chip.socket.incoming.size());
}
int WiFiClientSecureCtx::read(std::uint8_t* bytes, std::size_t size) {
  const std::size_t count = std::min(size, chip.socket.incoming.size());
  std::copy_n(chip.socket.incoming.begin(), count, bytes);
  chip.socket.incoming.erase(chip.socket.incoming.begin(), chip.socket.incoming.begin() + static_cast<long>(count));
  chip.socket.input_is_found = false;
  return static_cast<int>(count);
}
int WiFiClientSecureCtx::availableForWrite() { return chip.socket.connected && run_engine(true) ? 512 : 0; }
// As the core does it: record by record, with a flush after each.
std::size_t WiFiClientSecureCtx::write(const std::uint8_t* bytes, std::size_t size) {
  if (!connected()) return 0;
  chip.socket.writes.emplace_back(bytes, bytes + size);
  for (std::size_t sent = 0; sent < size; sent += 512) {
    if (!run_engine(true)) return sent;
    chip.socket.sealed = std::min<std::size_t>(512, size - sent) + 29;
    flush();
  }
  return size;
}
void WiFiClientSecureCtx::flush() {
  ++chip.socket.waiting_flushes;
  chip.blocks(40'000);
}
void WiFiClientSecureCtx::stop() {
  if (chip.socket.connected) ++chip.socket.closes;
  chip.blocks(300'000);
  chip.socket.connected = false;
  chip.socket.incoming.clear();
  chip.socket.sealed = 0;
  chip.socket.input_is_found = false;
}
void WiFiClientSecureCtx::setNoDelay(bool on) { chip.socket.no_delay = on; }
void WiFiClientSecureCtx::setKnownKey(const PublicKey* key) { chip.socket.known_key = key->pem; }
bool WiFiClientSecureCtx::setCiphers(const std::uint16_t*, int count) {
  chip.socket.ciphers = count;
  return true;
}
void WiFiClientSecureCtx::setBufferSizes(int receive, int send) {
  chip.socket.receive_bytes = receive;
  chip.socket.send_bytes = send;
}
void WiFiClientSecureCtx::setSession(Session*) {}
int WiFiClientSecureCtx::getMFLNStatus() { return chip.socket.connected && chip.socket.agrees_on_fragments; }

}  // namespace BearSSL
