/* Reset, traps (exit code 100 + cause), stack, and the calls to QEMU. It starts at 0x50000000, not at the ELF entry. */
  .section .vectors,"ax"
  .align 256
  .global _vecbase
_vecbase:
  .macro trap
  rsr a3, exccause
  movi a4, 100
  add a3, a3, a4
  movi a2, 1
  simcall
  .endm
  .org 0x10
  trap
  .org 0x30   /* kernel exception */
  trap
  .org 0x50   /* user exception */
  trap
  .org 0x70   /* double exception */
  trap
  .org 0x90
  .text
  .literal_position
  .align 4
  .global _start
_start:
  movi a2, 0x0f
  wsr a2, ps
  rsync
  movi a2, _vecbase
  wsr a2, vecbase
  rsync
  movi a1, __stack
  movi a2, __bss_start
  movi a3, __bss_end
  movi a4, 0
1: bgeu a2, a3, 2f
  s32i a4, a2, 0
  addi a2, a2, 4
  j 1b
2: call0 sim_main
  mov a3, a2
  movi a2, 1
  simcall
3: j 3b
  .align 4
  .global sim_write
sim_write:            /* (fd, buf, len) */
  mov a5, a4
  mov a4, a3
  mov a3, a2
  movi a2, 4
  simcall
  ret
  .align 4
  .global sim_read
sim_read:             /* (fd, buf, len) */
  mov a5, a4
  mov a4, a3
  mov a3, a2
  movi a2, 3
  simcall
  ret
  .align 4
  .global sim_ccount
sim_ccount:
  rsr a2, ccount
  ret
  .section .reset,"ax"
  .align 4
  .global _reset
_reset:
  j 1f
  .align 4
2: .word _start
1: l32r a0, 2b
  jx a0
