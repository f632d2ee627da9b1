// Puts samples at the ticks at which they were made, where a robot or a logger left some ticks out.
//
// A motor keeps its duty while no tick changes it, so the duty before a missed tick holds through it; nothing was
// measured there, so nothing there counts in a fit. Fills in every channel: positions and velocities on a straight
// line, accelerations with the last one, as a sensor that was not read. Errors: none thrown; what may be missed is
// asked of may_be_missed() first.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "control/search/fit.hpp"

namespace control {

inline constexpr std::size_t kMostMissedInARow = 25;  // 0.25 s at 100 Hz; a longer hole is one that nobody explains
inline constexpr double kMostMissedShare = 0.05;      // of the ticks

bool may_be_missed(std::size_t missed, std::size_t ticks);

// ticks[k]: at which tick sample k was made, ascending from 0. Positions with times of their own stay as they are.
void place_at_ticks(Recording& recording, std::span<const std::size_t> ticks);

std::size_t missed_ticks(const Recording& recording);

// A warning for the reader of the fit; empty: none was missed.
std::string missed_ticks_in_words(const Recording& recording);

}  // namespace control
