# rheonaut_embed(<target> <function> FILES <name>=<path>... [DEPENDS <target or file>...]): files as part of a room.
#
# <function>, such as server::migration_files, is then defined in the target and returns them as
# std::span<const base::EmbeddedFile>; a header of the room declares it. cmake/embed_files.py says what a path may be.
function(rheonaut_embed target function)
  cmake_parse_arguments(embed "" "" "FILES;DEPENDS" ${ARGN})
  string(REGEX REPLACE ".*::" "" name ${function})
  set(out ${CMAKE_CURRENT_BINARY_DIR}/embedded)
  file(MAKE_DIRECTORY ${out})
  set(files ${embed_FILES})
  list(FILTER files EXCLUDE REGEX "/$")
  list(TRANSFORM files REPLACE "^[^=]*=" "")
  add_custom_command(
    OUTPUT ${out}/${name}.S ${out}/${name}.cpp
    COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/cmake/embed_files.py ${function} ${out}/${name}.S ${out}/${name}.cpp
            ${out}/${name}.d ${embed_FILES}
    DEPENDS ${PROJECT_SOURCE_DIR}/cmake/embed_files.py ${files} ${embed_DEPENDS}
    DEPFILE ${out}/${name}.d
    COMMENT "Embedding ${name}"
    VERBATIM)
  target_sources(${target} PRIVATE ${out}/${name}.S ${out}/${name}.cpp)
  set_source_files_properties(${out}/${name}.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)  # all have the same names
endfunction()
