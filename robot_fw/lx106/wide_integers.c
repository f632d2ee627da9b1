// Arithmetic on 64 bits that the chip has in its mask ROM and libgcc.a therefore lacks.
#include <stdint.h>

uint64_t __udivmoddi4(uint64_t dividend, uint64_t divisor, uint64_t* remainder);  // libgcc.a
uint64_t __umulsidi3(uint32_t a, uint32_t b);
uint64_t __udivdi3(uint64_t dividend, uint64_t divisor);
uint64_t __umoddi3(uint64_t dividend, uint64_t divisor);
uint64_t __muldi3(uint64_t a, uint64_t b);

uint64_t __udivdi3(uint64_t dividend, uint64_t divisor) { return __udivmoddi4(dividend, divisor, 0); }

uint64_t __umoddi3(uint64_t dividend, uint64_t divisor) {
  uint64_t remainder = 0;
  __udivmoddi4(dividend, divisor, &remainder);
  return remainder;
}

uint64_t __muldi3(uint64_t a, uint64_t b) {
  const uint32_t a_high = (uint32_t)(a >> 32), b_high = (uint32_t)(b >> 32);
  const uint32_t cross = a_high * (uint32_t)b + (uint32_t)a * b_high;
  return __umulsidi3((uint32_t)a, (uint32_t)b) + ((uint64_t)cross << 32);
}
