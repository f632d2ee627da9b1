# Flags of the chip, and the routines that it has in its mask ROM: here from the compiler's own source.
set(NANOPB ${LX106_SOURCES}/nanopb)
set(cxx_headers ${LX106_SOURCES}/c++)
set(chip -Os -mlongcalls -mtext-section-literals -ffunction-sections -fdata-sections)
add_compile_options(${chip}
  "$<$<COMPILE_LANGUAGE:CXX>:-fno-exceptions;-fno-rtti;-fno-threadsafe-statics;-nostdinc++>"
  "$<$<COMPILE_LANGUAGE:CXX>:SHELL:-isystem ${cxx_headers} -isystem ${cxx_headers}/arm-none-eabi>"
  "SHELL:-isystem /usr/lib/xtensa-lx106-elf/include")
add_link_options(-nostartfiles -nostdlib -Wl,--gc-sections)

# One object for each routine, as in the compiler's own build.
add_library(soft_float STATIC ${CMAKE_CURRENT_LIST_DIR}/wide_integers.c)
target_include_directories(soft_float PRIVATE ${CMAKE_CURRENT_LIST_DIR})
foreach(routine addsubsf3 mulsf3 divsf3 cmpsf2 fixsfsi fixunssfsi fixsfdi fixunssfdi floatsisf floatdisf
                divsi3 modsi3 udivsi3 umodsi3 umulsidi3)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/soft_float/${routine}.S)
  file(CONFIGURE OUTPUT ${source} CONTENT "#define L_${routine}\n#include \"${LX106_SOURCES}/libgcc/lib1funcs.S\"\n")
  target_sources(soft_float PRIVATE ${source})
endforeach()
target_link_libraries(soft_float INTERFACE -lc -lgcc)
