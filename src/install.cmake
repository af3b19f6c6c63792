# SPDX-License-Identifier: GPL-2.0-or-later
# cmake --install: headers, libraries, the command, presets and data, and boleConfig.cmake.
install(TARGETS bole_library EXPORT boleTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS bole RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY include/bole DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})

set(BOLE_DATA_DIR ${CMAKE_INSTALL_DATADIR}/bole)
foreach(folder config models data)
  if(EXISTS ${PROJECT_SOURCE_DIR}/${folder})
    install(DIRECTORY ${folder} DESTINATION ${BOLE_DATA_DIR})
  endif()
endforeach()

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/bole)
install(EXPORT boleTargets NAMESPACE bole:: DESTINATION ${package_dir})
configure_package_config_file(src/boleConfig.cmake.in ${CMAKE_BINARY_DIR}/boleConfig.cmake
  INSTALL_DESTINATION ${package_dir} PATH_VARS BOLE_DATA_DIR)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/boleConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/boleConfig.cmake ${CMAKE_BINARY_DIR}/boleConfigVersion.cmake
  DESTINATION ${package_dir})
