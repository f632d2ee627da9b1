// Stub of the timer that makes waveforms.
#pragma once

#include <cstdint>

void setTimer1Callback(std::uint32_t (*function)());
