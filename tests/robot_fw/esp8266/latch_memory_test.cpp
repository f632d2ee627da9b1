// The emergency latch over a reset.
#include "robot_fw/esp8266/latch_memory.hpp"

#include <gtest/gtest.h>

#include "chip.hpp"

namespace robot_fw::esp8266 {
namespace {

class Memory : public ::testing::Test {
 protected:
  Memory() {
    chip = Chip{};
    chip.power_cycle();
  }
  static LatchMemory booted() {
    LatchMemory memory;
    memory.begin();
    return memory;
  }
};

TEST_F(Memory, IsNoiseAfterPowerOn) {
  EXPECT_FALSE(booted().kept());
  EXPECT_EQ(booted().emergency_id(), 0U);
}

TEST_F(Memory, LatchSurvivesAReset) {
  LatchMemory memory = booted();
  memory.keep(0x1234'5678'9ABC'DEF0, rheonaut_EMERGENCY_CAUSE_POSITION_LIMIT);
  chip.reset(4);
  EXPECT_TRUE(booted().kept());
  EXPECT_EQ(booted().emergency_id(), 0x1234'5678'9ABC'DEF0U);
  EXPECT_EQ(booted().cause(), rheonaut_EMERGENCY_CAUSE_POSITION_LIMIT);
}

TEST_F(Memory, ClearedLatchStaysCleared) {
  LatchMemory memory = booted();
  memory.keep(7, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  memory.keep(0, rheonaut_EMERGENCY_CAUSE_NONE);
  EXPECT_TRUE(booted().kept());
  EXPECT_EQ(booted().emergency_id(), 0U);
}

TEST_F(Memory, CorruptRecordDoesNotCount) {
  for (std::size_t word = 64; word < 69; ++word) {
    LatchMemory memory = booted();
    memory.keep(7 + word, rheonaut_EMERGENCY_CAUSE_OPERATOR);
    chip.rtc_memory[word] ^= 0x100;
    const LatchMemory next = booted();
    EXPECT_FALSE(next.kept()) << word;
    EXPECT_EQ(next.emergency_id(), 0U) << word;
  }
}

TEST_F(Memory, LeavesTheBootLoadersWordsAlone) {
  chip.rtc_memory.fill(0);
  LatchMemory memory = booted();
  memory.keep(~0ULL, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  for (std::size_t word = 0; word < 32; ++word) EXPECT_EQ(chip.rtc_memory[word], 0U);
}

}  // namespace
}  // namespace robot_fw::esp8266
