// QEMU's services for a program: files, a clock, exit.
#pragma once

#include <cstddef>
#include <cstdint>

namespace robot_fw::lx106 {

constexpr int kInput = 0, kOutput = 1, kFigures = 2;  // files that are open from the start

// False at the end of the input.
bool read_exactly(void* to, std::size_t size);
void write(int file, const char* text, std::size_t size);

// `key value\n` among the figures.
void write_figure(const char* key, std::uint32_t value);

// Instructions since some time; one step is 25, as QEMU's clock is 1 ns an instruction and the chip's cycle 25 ns.
constexpr std::uint32_t kInstructionsPerStep = 25;
std::uint32_t instructions();

}  // namespace robot_fw::lx106
