// Stub of the flash layout.
#pragma once

#include "chip.hpp"

#define FS_PHYS_ADDR (0x200000U)
#define FS_PHYS_SIZE (chip.flash_area_bytes)
