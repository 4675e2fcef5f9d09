# SPDX-License-Identifier: Apache-2.0
# Installs what an integrator's program links: the client library with the libraries below it, their headers, the
# messages as headers and as .proto files, and the CMake package emit_client (target emit::client).
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/emit_client)
set(package_targets emit_client emit_net emit_rt emit_protocol emit_protocol_messages emit_physics)
foreach(target IN LISTS package_targets)
  target_include_directories(${target} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
endforeach()
install(TARGETS ${package_targets} EXPORT emit_client_targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/emit COMPONENT client)
install(EXPORT emit_client_targets NAMESPACE emit:: DESTINATION ${package_dir} COMPONENT client)

foreach(folder server/client protocol renderer/physics)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder}/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT client)
endforeach()
install(DIRECTORY ${PROJECT_BINARY_DIR}/protocol/generated/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT client
  FILES_MATCHING PATTERN "*.pb.h")
install(DIRECTORY ${PROJECT_SOURCE_DIR}/protocol/proto/ DESTINATION ${CMAKE_INSTALL_DATADIR}/emit/proto COMPONENT client)

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/emit_clientConfig.cmake.in
  ${PROJECT_BINARY_DIR}/generated/emit_clientConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/generated/emit_clientConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/generated/emit_clientConfig.cmake
              ${PROJECT_BINARY_DIR}/generated/emit_clientConfigVersion.cmake
  DESTINATION ${package_dir} COMPONENT client)
