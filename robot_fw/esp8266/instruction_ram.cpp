// Finds the block by the names of the Arduino core.
#include "robot_fw/esp8266/instruction_ram.hpp"

#include <Arduino.h>
#include <mmu_iram.h>

// With MMU_IRAM_HEAP the block is the allocator's, and taking it would destroy what others have there.
#if !defined(MMU_SEC_HEAP) || !defined(MMU_SEC_HEAP_SIZE) || defined(MMU_IRAM_HEAP)
#error "Build with the MMU option 16KB cache + 32KB IRAM + 16KB 2nd Heap (not shared): docs/hardware.md, Flashing."
#endif

namespace robot_fw::esp8266 {

void* instruction_ram(std::size_t size_bytes) {
  return MMU_SEC_HEAP_SIZE < size_bytes ? nullptr : reinterpret_cast<void*>(MMU_SEC_HEAP);
}

}  // namespace robot_fw::esp8266
