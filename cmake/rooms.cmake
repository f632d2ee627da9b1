# rheonaut_room(<name> SOURCES ... [USES ...] [LIBRARIES ...]): a folder as a static library.
#
# USES names every room whose headers it includes; all of them stand before it in the order of ARCHITECTURE.md, which
# tests/check_rules.py holds both to. LIBRARIES come from the distribution.

# Which rooms share a precompiled header: a pattern of their names, and the room that has the header as
# precompiled.hpp. The first pattern that matches counts.
set(RHEONAUT_PRECOMPILED
  "^control_" control_models
  "^sim_robot_cli$" sim_robot_cli
  "^sim_robot_(client|fleet|proxy)$" sim_robot_client
  "^server_api_routes$" server_api_routes
  "^server_cli" server_cli_terminal
  "^server_" server_runtime)

# Sources of the station and of the simulated robot are compiled six at a time, because most of the time goes into
# headers; therefore names in the anonymous namespaces of one room differ. Those of control/ stay apart: there the time
# goes into code, and a change of one would compile its neighbours.
option(RHEONAUT_UNITY "Compile the sources of a room in groups" ON)

function(rheonaut_room name)
  cmake_parse_arguments(room "" "" "SOURCES;USES;LIBRARIES" ${ARGN})
  add_library(${name} STATIC ${room_SOURCES})
  target_compile_features(${name} PUBLIC cxx_std_23)
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${room_USES} ${room_LIBRARIES} PRIVATE project_warnings)
  if(RHEONAUT_UNITY AND name MATCHES "^(server|sim_robot)_")
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 6)
  endif()
  rheonaut_share_precompiled(${name})
endfunction()

function(rheonaut_share_precompiled name)
  set(pairs ${RHEONAUT_PRECOMPILED})
  while(pairs)
    list(POP_FRONT pairs pattern owner)
    if(name STREQUAL owner)
      target_precompile_headers(${name} PRIVATE precompiled.hpp)
      return()
    elseif(name MATCHES "${pattern}")
      target_precompile_headers(${name} REUSE_FROM ${owner})
      return()
    endif()
  endwhile()
endfunction()
