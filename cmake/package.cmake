# The Debian package: what is installed where, and what dpkg runs. deploy/package makes it.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # the package needs the programs, not the tests

# One configuration for both: that of the service is the annotated one, with its data where Debian keeps a service's.
file(READ ${PROJECT_SOURCE_DIR}/deploy/rheonaut.toml configuration)
string(REPLACE "dir = \"rheonaut-data\"" "dir = \"/var/lib/rheonaut\"" configuration "${configuration}")
if(NOT configuration MATCHES "/var/lib/rheonaut")
  message(FATAL_ERROR "deploy/rheonaut.toml has no line: dir = \"rheonaut-data\"")
endif()
set(package_files ${CMAKE_CURRENT_BINARY_DIR}/package_files)
file(WRITE ${package_files}/rheonaut.toml "${configuration}")
file(WRITE ${package_files}/conffiles "/etc/rheonaut/rheonaut.toml\n")

# What the programs are made of.
add_custom_command(
  OUTPUT ${package_files}/sbom.cdx.json
  COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/deploy/sbom $<TARGET_FILE:rheonaut> $<TARGET_FILE:rheonaut-sim>
    $<TARGET_FILE:rheonaut-export> > ${package_files}/sbom.cdx.json
  DEPENDS rheonaut rheonaut-sim rheonaut-export ${PROJECT_SOURCE_DIR}/deploy/sbom ${PROJECT_SOURCE_DIR}/web/package-lock.json)

# Whose licences they have. The page's packages are there once the page is built.
add_custom_command(
  OUTPUT ${package_files}/copyright
  COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/deploy/sbom --licences > ${package_files}/copyright
  DEPENDS rheonaut ${PROJECT_SOURCE_DIR}/LICENSE ${PROJECT_SOURCE_DIR}/deploy/sbom ${PROJECT_SOURCE_DIR}/web/package-lock.json)

# Manual pages and completions, from the command line's own definition.
set(pages ${package_files}/man1/rheonaut.1.gz)
add_custom_command(
  OUTPUT ${pages}
  COMMAND ${PROJECT_SOURCE_DIR}/deploy/pages $<TARGET_FILE:rheonaut> $<TARGET_FILE:rheonaut-sim> ${package_files}
  DEPENDS rheonaut rheonaut-sim ${PROJECT_SOURCE_DIR}/deploy/pages)
add_custom_target(package_files ALL DEPENDS ${package_files}/sbom.cdx.json ${package_files}/copyright ${pages})
install(DIRECTORY ${package_files}/man1 DESTINATION share/man)
install(FILES ${package_files}/rheonaut.bash DESTINATION share/bash-completion/completions RENAME rheonaut)
install(FILES ${package_files}/rheonaut-sim.bash DESTINATION share/bash-completion/completions RENAME rheonaut-sim)
install(FILES ${package_files}/_rheonaut DESTINATION share/zsh/vendor-completions)
install(FILES ${package_files}/rheonaut.fish DESTINATION share/fish/vendor_completions.d)

set(debian ${PROJECT_SOURCE_DIR}/deploy/debian)
install(TARGETS rheonaut rheonaut-sim RUNTIME DESTINATION bin)
install(TARGETS rheonaut-export RUNTIME DESTINATION libexec/rheonaut)  # where the station looks for it
install(FILES ${package_files}/rheonaut.toml DESTINATION /etc/rheonaut)
install(FILES ${debian}/rheonaut.service ${debian}/rheonaut-backup.service ${debian}/rheonaut-backup.timer
  DESTINATION /lib/systemd/system)
install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${PROJECT_SOURCE_DIR}/SECURITY.md
  ${package_files}/sbom.cdx.json ${package_files}/copyright DESTINATION share/doc/rheonaut)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/ DESTINATION share/doc/rheonaut/docs FILES_MATCHING PATTERN "*.md" PATTERN "*.svg"
  PATTERN decisions EXCLUDE PATTERN images EXCLUDE)
# A robot of one's own, beside the page that explains it.
install(PROGRAMS ${PROJECT_SOURCE_DIR}/examples/robot.py DESTINATION share/doc/rheonaut/examples)
install(FILES ${PROJECT_SOURCE_DIR}/examples/station_link.py DESTINATION share/doc/rheonaut/examples)
install(FILES ${PROJECT_SOURCE_DIR}/protocol/robot.proto DESTINATION share/doc/rheonaut/protocol)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/deploy/proxy ${PROJECT_SOURCE_DIR}/deploy/prometheus
  ${PROJECT_SOURCE_DIR}/deploy/grafana DESTINATION share/doc/rheonaut/deploy)
install(PROGRAMS ${debian}/backup-daily DESTINATION libexec/rheonaut)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME rheonaut)
set(CPACK_PACKAGE_CONTACT "The Rheonaut authors <authors@rheonaut.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "ground station for small swimming robots")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"A server that robots connect to over TCP or TLS. It carries commands and emergency
stops, records every sample in one SQLite file, performs experiments, identifies
models and tunes fractional-order controllers, and serves an HTTP interface and a
cockpit in the browser. A simulated robot is included: run 'rheonaut demo'.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "adduser, debconf | debconf-2.0, init-system-helpers")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
  ${package_files}/conffiles ${debian}/postinst ${debian}/prerm ${debian}/postrm ${debian}/templates)
include(CPack)
