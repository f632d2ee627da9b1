// Stub of the Arduino core for the ESP8266: what the robot uses of it, over the chip of chip.hpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "user_interface.h"

#define IRAM_ATTR
#define F_CPU 80000000L
#define clockCyclesPerMicrosecond() (F_CPU / 1000000L)

constexpr std::uint8_t LOW = 0, HIGH = 1;
constexpr std::uint8_t INPUT = 0, OUTPUT = 1, INPUT_PULLUP = 2;
constexpr std::uint8_t A0 = 17;

// A register that sets or clears the pins written to it.
class SetRegister {
 public:
  explicit SetRegister(bool high) : high_(high) {}
  SetRegister& operator=(std::uint32_t mask);

 private:
  bool high_;
};
extern SetRegister GPOS;
extern SetRegister GPOC;

unsigned long micros();
std::uint32_t esp_get_cycle_count();
void pinMode(std::uint8_t pin, std::uint8_t mode);
void digitalWrite(std::uint8_t pin, std::uint8_t level);
int digitalRead(std::uint8_t pin);
int analogRead(std::uint8_t pin);

class EspClass {
 public:
  std::uint32_t random();
  std::uint32_t getFreeHeap();
  void wdtEnable(std::uint32_t timeout_ms);
  void wdtFeed();
  rst_info* getResetInfoPtr();
  bool rtcUserMemoryRead(std::uint32_t offset, std::uint32_t* words, std::size_t size);
  bool rtcUserMemoryWrite(std::uint32_t offset, std::uint32_t* words, std::size_t size);
  bool flashEraseSector(std::uint32_t sector);
  bool flashWrite(std::uint32_t address, std::uint32_t* words, std::size_t size);
  bool flashRead(std::uint32_t address, std::uint32_t* words, std::size_t size);
};
extern EspClass ESP;
