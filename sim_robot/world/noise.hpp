// Random numbers of the sensors: small, fast, and the same for a seed on every machine.
//
// xoshiro256++ (Blackman and Vigna, 2019), seeded by splitmix64; normal numbers in pairs by Marsaglia's polar method.
// The standard library's are several times as slow, keep 2.5 kB each, and differ between libraries.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace sim_robot {

class Noise {
 public:
  explicit Noise(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {
      seed += 0x9E3779B97F4A7C15U;
      std::uint64_t mixed = (seed ^ (seed >> 30)) * 0xBF58476D1CE4E5B9U;
      mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBU;
      word = mixed ^ (mixed >> 31);
    }
  }

  double uniform() { return 0x1p-53 * static_cast<double>(next() >> 11); }  // in [0, 1)

  // Mean 0, sd 1.
  double normal() {
    if (has_second_) {
      has_second_ = false;
      return second_;
    }
    double x, y, square;
    do {
      x = 2 * uniform() - 1;
      y = 2 * uniform() - 1;
      square = x * x + y * y;
    } while (square >= 1 || square == 0);
    const double scale = std::sqrt(-2 * std::log(square) / square);
    second_ = y * scale;
    has_second_ = true;
    return x * scale;
  }

 private:
  std::uint64_t next() {
    auto& s = state_;
    const std::uint64_t result = std::rotl(s[0] + s[3], 23) + s[0], shifted = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= shifted;
    s[3] = std::rotl(s[3], 45);
    return result;
  }

  std::array<std::uint64_t, 4> state_{};
  double second_ = 0;
  bool has_second_ = false;
};

}  // namespace sim_robot
