// What is known of an accelerometer before its readings are: the figures of its data sheet, each with an sd.
//
//   ln(τ/τ_0) ~ N(0, kLowPassSd),  τ_0 = 1/(2π 62.5 Hz)                 (1)   [bno055] bandwidth of the fusion
//   lag of a sample ~ N(0 or the lag that is given, kLagSdS)            (2)   half a period of its output, 10 ms
//   P/dt - 1 ~ N(0, kClockSd)                                           (3)   its oscillator
//
// (1) decides: a record of a minute knows τ to 0.7 ms only, and a low pass that is too short looks like orders that are
// too high. (2) and (3) are wide beside what a record shows, and keep a search where it shows nothing. The data sheet
// gives the bandwidth and the period without tolerances: the three sds are assumed.
// Errors: none thrown.
#pragma once

#include <numbers>

namespace control {

inline constexpr double kDataSheetBandwidthHz = 62.5;
inline constexpr double kDataSheetTimeConstantS = 1 / (2 * std::numbers::pi * kDataSheetBandwidthHz);  // 2.55 ms
inline constexpr double kLowPassSd = 0.1;
inline constexpr double kLagSdS = 0.005;
inline constexpr double kClockSd = 0.005;

}  // namespace control
