// Instruction RAM that the program may use for data, read and written as whole words of 32 bits only.
//
// The chip has 64 kB of it: 32 kB for code, 32 kB for the cache of code in flash. With the MMU option "16KB cache +
// 32KB IRAM + 16KB 2nd Heap (not shared)" the cache gets 16 kB and the program the rest. The core's allocator does not
// know that block, and its HeapSelectIram would quietly hand out ordinary memory: it is taken by its address.
#pragma once

#include <cstddef>

namespace robot_fw::esp8266 {

// The block, aligned to words, for its only user; null when it is smaller than that. Survives a reset, not a loss of
// power, and nobody clears it.
void* instruction_ram(std::size_t size_bytes);

}  // namespace robot_fw::esp8266
