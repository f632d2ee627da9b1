// Arithmetic on pairs of float bit patterns, the results as one checksum for each operation and block.
//
// Host and chip draw the same pairs and must agree in every bit; any NaN counts as the same. The pairs: any patterns,
// neighbours, subnormals, products and quotients that are subnormal, zeros, infinities and NaN.
#pragma once

#include <cstddef>
#include <cstdint>

namespace robot_fw::lx106 {

enum class FloatOperation : std::uint8_t {
  add,
  subtract,
  multiply,
  divide,
  root,
  compare,
  from_int32,
  from_uint32,
  from_int64,
  from_uint64,
  to_int32,
  to_uint32,
  to_uint64,
};
constexpr std::size_t kFloatOperations = 13;
constexpr std::uint32_t kFloatBlocks = 1000, kPairsPerBlock = 1000;

const char* name_of(FloatOperation operation);

struct FloatPair {
  std::uint32_t a_bits = 0, b_bits = 0;
};

// The pairs of a block, in order.
class FloatPairs {
 public:
  explicit FloatPairs(std::uint32_t block) : state_(block * 0x9E37'79B9U + 1) {}
  FloatPair next();

 private:
  std::uint32_t draw();

  std::uint32_t state_;
};

// The bits of the result; for integers of 64 bits both halves, mixed.
std::uint32_t result_bits(FloatOperation operation, const FloatPair& pair);

// "block N" and the checksum of each operation; or "operation a b result". In hexadecimal, with the end of the line.
constexpr std::size_t kMaxTrialLineBytes = 16 + 9 * kFloatOperations;
std::size_t describe_block(std::uint32_t block, char (&line)[kMaxTrialLineBytes]);
std::size_t describe_pair(FloatOperation operation, const FloatPair& pair, char (&line)[kMaxTrialLineBytes]);

}  // namespace robot_fw::lx106
