// Stub of the second heap in instruction RAM, "not shared": a block that no allocator knows.
#pragma once

#include "chip.hpp"

#define MMU_SEC_HEAP chip.instruction_ram.data()
#define MMU_SEC_HEAP_SIZE chip.instruction_ram_bytes
