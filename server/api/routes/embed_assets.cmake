# Embeds the built cockpit and openapi.yaml in the library server_api_routes. RHEONAUT_WEB_DIST may name a cockpit that was built
# elsewhere; otherwise it is what the target web_dist makes. Without either the station answers with a plain page.
set(RHEONAUT_WEB_DIST "${CMAKE_BINARY_DIR}/web/dist" CACHE PATH "Folder of the built cockpit to embed")
find_program(PYTHON3 python3 REQUIRED)
set(assets ${CMAKE_CURRENT_BINARY_DIR}/assets)
set(openapi ${CMAKE_CURRENT_SOURCE_DIR}/../openapi.yaml)
set(cockpit)
if(TARGET web_dist AND RHEONAUT_WEB_DIST STREQUAL "${CMAKE_BINARY_DIR}/web/dist")
  list(APPEND cockpit web_dist ${CMAKE_BINARY_DIR}/web/dist/index.html)
elseif(EXISTS ${RHEONAUT_WEB_DIST}/index.html)
  list(APPEND cockpit ${RHEONAUT_WEB_DIST}/index.html)
endif()
file(MAKE_DIRECTORY ${assets})
add_custom_command(
  OUTPUT ${assets}/embedded_files.S ${assets}/embedded_table.cpp
  COMMAND ${PYTHON3} ${CMAKE_CURRENT_SOURCE_DIR}/embed_assets.py ${RHEONAUT_WEB_DIST} ${openapi}
          ${assets}/embedded_files.S ${assets}/embedded_table.cpp
  DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/embed_assets.py ${openapi} ${cockpit}
  COMMENT "Embedding the cockpit")
target_sources(server_api_routes PRIVATE ${assets}/embedded_files.S ${assets}/embedded_table.cpp)
