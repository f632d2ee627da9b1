# Embeds the built cockpit in server_api_routes, its texts compressed. RHEONAUT_WEB_DIST may name a cockpit that was built
# elsewhere; otherwise it is what the target web_dist makes. Without either the station answers with a plain page.
set(RHEONAUT_WEB_DIST "${CMAKE_BINARY_DIR}/web/dist" CACHE PATH "Folder of the built cockpit to embed")
set(cockpit)
if(TARGET web_dist AND RHEONAUT_WEB_DIST STREQUAL "${CMAKE_BINARY_DIR}/web/dist")
  list(APPEND cockpit web_dist ${CMAKE_BINARY_DIR}/web/dist/index.html)
elseif(EXISTS ${RHEONAUT_WEB_DIST}/index.html)
  list(APPEND cockpit ${RHEONAUT_WEB_DIST}/index.html)
endif()
set(compressed ${CMAKE_CURRENT_BINARY_DIR}/cockpit)
add_custom_command(
  OUTPUT ${compressed}.made
  COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/cmake/gzip_texts.py ${RHEONAUT_WEB_DIST} ${compressed}
  COMMAND ${CMAKE_COMMAND} -E touch ${compressed}.made
  DEPENDS ${PROJECT_SOURCE_DIR}/cmake/gzip_texts.py ${cockpit}
  DEPFILE ${compressed}.d
  COMMENT "Compressing the cockpit's texts"
  VERBATIM)
rheonaut_embed(server_api_routes server::api::cockpit_files FILES /=${compressed}/ DEPENDS ${compressed}.made)
