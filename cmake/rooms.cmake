# rheonaut_room(<name> SOURCES ... [USES ...] [LIBRARIES ...]): a folder as a static library.
#
# USES names every room whose headers it includes; all of them stand before it in the order of ARCHITECTURE.md, which
# tests/check_rules.py holds both to. LIBRARIES come from the distribution. Rooms of the station share a precompiled
# header, which the first of them has.
function(rheonaut_room name)
  cmake_parse_arguments(room "" "" "SOURCES;USES;LIBRARIES" ${ARGN})
  add_library(${name} STATIC ${room_SOURCES})
  target_compile_features(${name} PUBLIC cxx_std_23)
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${room_USES} ${room_LIBRARIES} PRIVATE project_warnings)
  if(name STREQUAL "server_runtime")
    target_precompile_headers(${name} PRIVATE precompiled.hpp)
  elseif(name MATCHES "^server_")
    target_precompile_headers(${name} REUSE_FROM server_runtime)
  endif()
endfunction()
