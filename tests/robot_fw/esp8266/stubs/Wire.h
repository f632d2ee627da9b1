// Stub of the Arduino I2C library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

class TwoWire {
 public:
  void begin(int sda, int scl);
  void setClock(std::uint32_t hz);
  void setClockStretchLimit(std::uint32_t us);
  std::uint8_t status();
  void beginTransmission(std::uint8_t address);
  std::size_t write(std::uint8_t byte);
  std::uint8_t endTransmission(std::uint8_t send_stop = 1);
  std::uint8_t requestFrom(std::uint8_t address, std::uint8_t count);
  int read();

 private:
  std::uint8_t address_ = 0;
  std::uint8_t register_ = 0;
  std::vector<std::uint8_t> written_;
};
extern TwoWire Wire;
