// Puts samples at the ticks at which they were made, where a robot or a logger left some ticks out.
//
// The duty holds for kMotorOffS after the last tick and is 0 from there to the next: so the board of this robot does
// it, and of another robot it is an assumption. Nothing was measured at a missed tick, so a fit leaves it out. Fills in
// every channel: positions and velocities on a straight line, accelerations with the last one, as a sensor that was not
// read. Errors: none thrown; what may be missed is asked of may_be_missed() and most_missed_in_a_row() first.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "control/search/fit.hpp"

namespace control {

inline constexpr double kMotorOffS = 0.05;        // robot_fw::kMotorOffS; a period that is longer holds to its end
inline constexpr double kLongestMissedS = 0.25;   // in a row; a longer hole is one that nobody explains
inline constexpr double kMostMissedShare = 0.05;  // of the ticks

double most_missed_in_a_row(double dt_s);  // ticks
bool may_be_missed(std::size_t missed, std::size_t ticks);

// ticks[k]: at which tick sample k was made, ascending from 0. Positions with times of their own stay as they are.
void place_at_ticks(Recording& recording, std::span<const std::size_t> ticks);

std::size_t missed_ticks(const Recording& recording);

// Ticks whose values do not count in a fit: missed, or left out. Empty: all count.
std::vector<bool> uncounted_ticks(const Recording& recording);

double share_used(std::span<const Recording> recordings);  // of their ticks, that count

// A warning for the reader of the fit; empty: none was missed.
std::string missed_ticks_in_words(const Recording& recording);

}  // namespace control
