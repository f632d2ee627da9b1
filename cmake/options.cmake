# Compiler options as interface targets: a folder links what applies to it.

# Warnings of our own code, errors all of them.
add_library(project_warnings INTERFACE)
target_compile_options(project_warnings INTERFACE
  -Wall -Wextra -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor -Woverloaded-virtual -Wimplicit-fallthrough
  -Werror)

# The dialect of code that also runs on the robot: no exceptions, no run-time types, no silent double arithmetic.
add_library(firmware_dialect INTERFACE)
target_compile_options(firmware_dialect INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-fno-exceptions -fno-rtti -Wdouble-promotion -Wfloat-conversion>)

# A product and a sum are rounded one after the other on each processor, so that all of them compute the same digits.
add_compile_options(-ffp-contract=off)

# RHEONAUT_SANITIZE: a list for -fsanitize, empty for none. `enum` is left out because protobuf enumerators are open:
# a newer peer may send a value that this version does not know; `vptr` because it asks by a pipe whether an object may be
# read, and so ends a station that has no descriptor left. Checks of each pointer take a third of the compiler's
# time, so the fuzz preset alone has all of them; elsewhere `alignment` is checked in what also runs on the robot, whose
# processor has no unaligned access.
set(RHEONAUT_SANITIZE "" CACHE STRING "Sanitizers, as for -fsanitize=")
if(RHEONAUT_SANITIZE)
  add_compile_options(-fsanitize=${RHEONAUT_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  if(RHEONAUT_SANITIZE MATCHES "undefined")
    add_compile_options(-fno-sanitize=enum,vptr)
    if(NOT RHEONAUT_SANITIZE MATCHES "fuzzer")
      add_compile_options(-fno-sanitize=null,object-size,alignment)
      target_compile_options(firmware_dialect INTERFACE -fsanitize=alignment)
    endif()
  endif()
  add_link_options(-fsanitize=${RHEONAUT_SANITIZE})
endif()

# Without it a precompiled header differs each time it is made, and the compiler cache never finds its users again.
add_compile_options("$<$<COMPILE_LANG_AND_ID:CXX,Clang>:SHELL:-Xclang -fno-pch-timestamp>")
