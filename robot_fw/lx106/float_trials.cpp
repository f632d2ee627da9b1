// Draws the pairs and computes; compiled alike for host and chip.
#include "robot_fw/lx106/float_trials.hpp"

#include <cmath>
#include <cstring>
#include <iterator>

#include "robot_fw/core/saturate.hpp"

namespace robot_fw::lx106 {
namespace {

constexpr std::uint32_t kSignBit = 0x8000'0000U, kFractionBits = 0x007F'FFFFU;
constexpr std::uint32_t kSpecial[] = {0,
                                      1,
                                      kFractionBits,
                                      0x0080'0000U,
                                      0x3F80'0000U,
                                      0x7F7F'FFFFU,
                                      0x7F80'0000U,
                                      0x7FC0'0000U,
                                      0x7FA0'0000U,
                                      0x4F00'0000U,
                                      0x4F80'0000U,
                                      0x5F80'0000U};

float float_of(std::uint32_t bits) {
  float value = 0;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

std::uint32_t bits_of(float value) {
  if (value != value) return 0x7FC0'0000U;
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits;
}

std::uint32_t mixed(std::uint64_t value) {
  return static_cast<std::uint32_t>(value) ^ (static_cast<std::uint32_t>(value >> 32) * 0x9E37'79B9U);
}

std::uint32_t compared(float a, float b) {
  return static_cast<std::uint32_t>(a < b) | static_cast<std::uint32_t>(a <= b) << 1 |
         static_cast<std::uint32_t>(a == b) << 2 | static_cast<std::uint32_t>(a != b) << 3 |
         static_cast<std::uint32_t>(a >= b) << 4 | static_cast<std::uint32_t>(a > b) << 5 |
         static_cast<std::uint32_t>(std::isunordered(a, b)) << 6;
}

std::uint32_t with_exponent(std::uint32_t bits, std::uint32_t exponent) {
  return (bits & (kSignBit | kFractionBits)) | exponent << 23;
}

char* put_hex(char* at, std::uint32_t value) {
  *at++ = ' ';
  for (unsigned shift = 32; shift > 0; shift -= 4) *at++ = "0123456789abcdef"[(value >> (shift - 4)) & 15];
  return at;
}

}  // namespace

const char* name_of(FloatOperation operation) {
  static constexpr const char* kNames[] = {"add",      "subtract",   "multiply",    "divide",     "sqrtf",
                                           "compare",  "from_int32", "from_uint32", "from_int64", "from_uint64",
                                           "to_int32", "to_uint32",  "to_uint64"};
  return kNames[static_cast<std::size_t>(operation)];
}

// xorshift32 of Marsaglia.
std::uint32_t FloatPairs::draw() {
  state_ ^= state_ << 13;
  state_ ^= state_ >> 17;
  return state_ ^= state_ << 5;
}

FloatPair FloatPairs::next() {
  const std::uint32_t kind = draw() >> 8, a = draw(), b = draw();
  const std::uint32_t exponent = (kind >> 8) & 0x7F, depth = (kind >> 16) & 31;  // below the smallest normal number
  switch (kind & 7) {
    case 0: return {a, with_exponent(b, 0)};
    case 1: return {with_exponent(a, 0), with_exponent(b, 0)};
    case 2: return {a, a + (b & 15) - 8 + (b & kSignBit)};  // neighbours
    case 3: return {with_exponent(a, exponent), with_exponent(b, exponent < 99 ? 130 - exponent - depth : 1)};
    case 4: return {with_exponent(a, exponent), with_exponent(b, exponent < 99 ? exponent + 125 + depth : 254)};
    case 5: return {with_exponent(a, 120 + depth), with_exponent(b, 120 + exponent % 32)};
    case 6: return {kSpecial[(kind >> 3) % std::size(kSpecial)] | (a & kSignBit), b};
    default: return {a, b};
  }
}

std::uint32_t result_bits(FloatOperation operation, const FloatPair& pair) {
  const float a = float_of(pair.a_bits), b = float_of(pair.b_bits);
  const std::uint64_t wide = std::uint64_t{pair.a_bits} << 32 | pair.b_bits;
  const unsigned shift = pair.b_bits % 64;
  switch (operation) {
    case FloatOperation::add: return bits_of(a + b);
    case FloatOperation::subtract: return bits_of(a - b);
    case FloatOperation::multiply: return bits_of(a * b);
    case FloatOperation::divide: return bits_of(a / b);
    case FloatOperation::root: return bits_of(std::sqrt(a));
    case FloatOperation::compare: return compared(a, b);
    case FloatOperation::from_int32: return bits_of(static_cast<float>(static_cast<std::int32_t>(pair.a_bits)));
    case FloatOperation::from_uint32: return bits_of(static_cast<float>(pair.a_bits));
    case FloatOperation::from_int64: return bits_of(static_cast<float>(static_cast<std::int64_t>(wide) >> shift));
    case FloatOperation::from_uint64: return bits_of(static_cast<float>(wide >> shift));
    case FloatOperation::to_int32: return static_cast<std::uint32_t>(saturated<std::int32_t>(a));
    case FloatOperation::to_uint32: return saturated<std::uint32_t>(a);
    case FloatOperation::to_uint64: return mixed(saturated<std::uint64_t>(a));
  }
  return 0;
}

std::size_t describe_block(std::uint32_t block, char (&line)[kMaxTrialLineBytes]) {
  std::uint32_t checksums[kFloatOperations] = {};
  FloatPairs pairs(block);
  for (std::uint32_t i = 0; i < kPairsPerBlock; ++i) {
    const FloatPair pair = pairs.next();
    for (std::size_t j = 0; j < kFloatOperations; ++j) {
      checksums[j] = (checksums[j] ^ result_bits(static_cast<FloatOperation>(j), pair)) * 0x0100'0193U;  // FNV-1a
    }
  }
  std::memcpy(line, "block", 5);
  char* at = put_hex(line + 5, block);
  for (const std::uint32_t checksum : checksums) at = put_hex(at, checksum);
  *at++ = '\n';
  return static_cast<std::size_t>(at - line);
}

std::size_t describe_pair(FloatOperation operation, const FloatPair& pair, char (&line)[kMaxTrialLineBytes]) {
  const std::size_t size = std::strlen(name_of(operation));
  std::memcpy(line, name_of(operation), size);
  char* at = put_hex(put_hex(put_hex(line + size, pair.a_bits), pair.b_bits), result_bits(operation, pair));
  *at++ = '\n';
  return static_cast<std::size_t>(at - line);
}

}  // namespace robot_fw::lx106
