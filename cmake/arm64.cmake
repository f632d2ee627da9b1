# For arm64 (a Raspberry Pi with a 64-bit Debian 12), by this machine's clang against a Debian tree. deploy/arm64 makes
# the tree and names it in RHEONAUT_ARM64_TREE.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES RHEONAUT_ARM64_TREE)
set(CMAKE_SYSROOT ${RHEONAUT_ARM64_TREE})
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
foreach(language C CXX ASM)
  set(CMAKE_${language}_COMPILER_TARGET aarch64-linux-gnu)
endforeach()
set(CMAKE_C_COMPILER clang-19)
set(CMAKE_CXX_COMPILER clang++-19)
set(CMAKE_ASM_COMPILER clang-19)
set(CMAKE_EXE_LINKER_FLAGS_INIT -fuse-ld=lld-19)

# Programs that the build runs are this machine's; libraries and headers are the tree's.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${RHEONAUT_ARM64_TREE})
set(ENV{PKG_CONFIG_LIBDIR} ${RHEONAUT_ARM64_TREE}/usr/lib/aarch64-linux-gnu/pkgconfig:${RHEONAUT_ARM64_TREE}/usr/share/pkgconfig)

# CTest runs the test programs through it.
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L ${RHEONAUT_ARM64_TREE})
