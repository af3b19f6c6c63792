# SPDX-License-Identifier: GPL-2.0-or-later
# cmake --install: the library, its public headers, the command with presets, models and demonstration flight, and what
# find_package(bole) reads, here and in the build tree. src/package.cmake makes Debian packages of the components.
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/bole)
set(BOLE_DATA_DIR ${CMAKE_INSTALL_DATADIR}/bole)

install(TARGETS bole_library bole_derived EXPORT boleTargets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development)
install(DIRECTORY include/bole DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development FILES_MATCHING PATTERN *.h)
install(TARGETS bole RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT command)
install(TARGETS bole_commands LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/bole COMPONENT command)
install(DIRECTORY config models data DESTINATION ${BOLE_DATA_DIR} COMPONENT command PATTERN figures EXCLUDE)

install(EXPORT boleTargets NAMESPACE bole:: DESTINATION ${package_dir} COMPONENT development)
configure_package_config_file(src/boleConfig.cmake.in ${PROJECT_BINARY_DIR}/installed/boleConfig.cmake
  INSTALL_DESTINATION ${package_dir} PATH_VARS BOLE_DATA_DIR)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/boleConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/installed/boleConfig.cmake ${PROJECT_BINARY_DIR}/boleConfigVersion.cmake
  DESTINATION ${package_dir} COMPONENT development)

# The build tree: its presets and flight are those of the sources.
set(BOLE_DATA_DIR ${PROJECT_SOURCE_DIR})
export(EXPORT boleTargets NAMESPACE bole:: FILE ${PROJECT_BINARY_DIR}/boleTargets.cmake)
configure_package_config_file(src/boleConfig.cmake.in ${PROJECT_BINARY_DIR}/boleConfig.cmake
  INSTALL_DESTINATION ${PROJECT_BINARY_DIR} INSTALL_PREFIX ${PROJECT_BINARY_DIR} PATH_VARS BOLE_DATA_DIR)

# Man pages and completions, by the command itself from its definitions.
set(documentation ${PROJECT_BINARY_DIR}/documentation)
add_custom_command(OUTPUT ${documentation}/_bole COMMAND bole documentation ${documentation} DEPENDS bole
  COMMENT "Writing man pages and completions")
add_custom_target(bole_documentation ALL DEPENDS ${documentation}/_bole)
install(DIRECTORY ${documentation}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT command
  FILES_MATCHING PATTERN *.1)
install(FILES ${documentation}/bole.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME bole
  COMPONENT command)
install(FILES ${documentation}/_bole DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions COMPONENT command)

include(src/package.cmake)

# Folders that everybody may read, whatever the umask of who installs: CMake makes them by the umask.
install(CODE [[
  foreach(folder IN LISTS CMAKE_INSTALL_MANIFEST_FILES)
    while(folder AND NOT folder STREQUAL CMAKE_INSTALL_PREFIX AND NOT folder STREQUAL "/")
      get_filename_component(folder "${folder}" DIRECTORY)
      list(APPEND folders "$ENV{DESTDIR}${folder}")
    endwhile()
  endforeach()
  list(REMOVE_DUPLICATES folders)
  execute_process(COMMAND chmod a+rX ${folders} ERROR_QUIET)
]])
