// The function that libFuzzer calls, for the target that the macro FUZZ_TARGET names (tests/fuzz/CMakeLists.txt).
#include "tests/fuzz/targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {  // NOLINT
  return fuzz::FUZZ_TARGET(data, size);
}
