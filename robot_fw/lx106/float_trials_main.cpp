// The float trials on the chip's instruction set. Input: nothing for all blocks, or 4 bytes, a block to print in
// detail.
#include "robot_fw/lx106/float_trials.hpp"
#include "robot_fw/lx106/simulator.hpp"

extern "C" int sim_main() {
  using namespace robot_fw::lx106;
  static char line[kMaxTrialLineBytes];
  std::uint32_t block = 0;
  if (!read_exactly(&block, sizeof(block))) {
    for (block = 0; block < kFloatBlocks; ++block) write(kOutput, line, describe_block(block, line));
    return 0;
  }
  FloatPairs pairs(block);
  for (std::uint32_t i = 0; i < kPairsPerBlock; ++i) {
    const FloatPair pair = pairs.next();
    for (std::size_t j = 0; j < kFloatOperations; ++j) {
      write(kOutput, line, describe_pair(static_cast<FloatOperation>(j), pair, line));
    }
  }
  return 0;
}
