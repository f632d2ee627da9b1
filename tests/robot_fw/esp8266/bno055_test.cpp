// The accelerometer: start, readings, failures, and starting anew.
#include "robot_fw/esp8266/bno055.hpp"

#include <gtest/gtest.h>

#include "chip.hpp"

namespace robot_fw::esp8266 {
namespace {

class Sensor : public ::testing::Test {
 protected:
  Sensor() {
    chip = Chip{};
    chip.imu_registers[0x00] = 0xA0;
  }
  void put(std::uint8_t address, std::int16_t value) {
    chip.imu_registers[address] = static_cast<std::uint8_t>(value & 0xFF);
    chip.imu_registers[address + 1] = static_cast<std::uint8_t>(value >> 8 & 0xFF);
  }
  // A tick.
  Bno055::Reading next(Bno055& imu) {
    now_us += 10'000;
    return imu.read(now_us);
  }
  void start(Bno055& imu) {
    imu.begin(now_us);
    for (int i = 0; i < 100 && !imu.running(); ++i) next(imu);
    ASSERT_TRUE(imu.running());
  }
  std::uint64_t now_us = 0;
};

TEST_F(Sensor, StartsInFusionWithoutMagnetometerWithinASecond) {
  Bno055 imu{{}};
  start(imu);
  EXPECT_EQ(chip.imu_registers[0x3D], 0x08);
  EXPECT_LT(now_us, 1'000'000U);
}

TEST_F(Sensor, ReadsTheAxisAlongTheTube) {
  put(0x28, 123);
  put(0x2A, -250);
  put(0x2C, INT16_MIN);
  chip.imu_registers[0x35] = 0b00'11'10'00;
  Bno055 x{{}}, y{{.axis = 1, .reversed = true}}, z{{.axis = 2, .reversed = true}};
  start(x);
  const Bno055::Reading reading = next(x);
  EXPECT_TRUE(reading.is_valid);
  EXPECT_EQ(reading.acceleration_counts, 123);
  EXPECT_EQ(reading.calibration, 2U);
  start(y);
  EXPECT_EQ(next(y).acceleration_counts, 250);
  start(z);
  EXPECT_EQ(next(z).acceleration_counts, INT16_MAX);
}

TEST_F(Sensor, OfAnotherKindIsNeverRead) {
  chip.imu_registers[0x00] = 0x55;
  Bno055 imu{{}};
  imu.begin(0);
  for (int i = 0; i < 500; ++i) EXPECT_FALSE(next(imu).is_valid);
  chip.imu_registers[0x00] = 0xA0;
  for (int i = 0; i < 100; ++i) next(imu);
  EXPECT_TRUE(imu.running()) << "it is asked again and again";
}

TEST_F(Sensor, FailedReadIsInvalidAndTheNextMaySucceed) {
  Bno055 imu{{}};
  start(imu);
  chip.imu_there = false;
  EXPECT_FALSE(next(imu).is_valid);
  chip.imu_there = true;
  EXPECT_TRUE(next(imu).is_valid);
}

TEST_F(Sensor, IsStartedAnewAfterTenFailures) {
  Bno055 imu{{}};
  start(imu);
  const int starts = chip.bus_starts;
  chip.imu_there = false;
  for (int i = 0; i < 10; ++i) next(imu);
  EXPECT_FALSE(imu.running());
  EXPECT_EQ(chip.bus_starts, starts + 1) << "the bus too";
  chip.imu_there = true;
  for (int i = 0; i < 30; ++i) next(imu);
  EXPECT_TRUE(next(imu).is_valid);
}

TEST_F(Sensor, ThatHoldsTheDataLineIsClockedOut) {
  Bno055 imu{{}};
  start(imu);
  chip.imu_holds_data_line = true;
  for (int i = 0; i < 40; ++i) next(imu);
  EXPECT_TRUE(next(imu).is_valid);
}

TEST_F(Sensor, FailedLookAtItsModeIsAFailedReadAndNoMore) {
  Bno055 imu{{}};
  start(imu);
  const int starts = chip.bus_starts;
  for (int i = 0; i < 99; ++i) EXPECT_TRUE(next(imu).is_valid);
  chip.imu_reads_to_fail = 1;
  EXPECT_FALSE(next(imu).is_valid);
  EXPECT_TRUE(next(imu).is_valid);
  EXPECT_EQ(chip.bus_starts, starts);
}

TEST_F(Sensor, ThatHasLeftItsModeIsStartedAnew) {
  Bno055 imu{{}};
  start(imu);
  chip.imu_registers[0x3D] = 0x00;  // as after a dip of its supply
  int invalid = 0;
  for (int i = 0; i < 200; ++i) invalid += !next(imu).is_valid;
  EXPECT_GT(invalid, 0);
  EXPECT_EQ(chip.imu_registers[0x3D], 0x08);
  EXPECT_TRUE(next(imu).is_valid);
}

}  // namespace
}  // namespace robot_fw::esp8266
