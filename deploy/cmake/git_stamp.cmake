# SPDX-License-Identifier: Apache-2.0
# Target emit_version: header emit/version.hpp with version and commit, refreshed at every build.
set(emit_version_dir "${PROJECT_BINARY_DIR}/generated/version")
add_custom_target(emit_version_stamp ALL
  COMMAND ${CMAKE_COMMAND} -DSOURCE_DIR=${PROJECT_SOURCE_DIR} -DVERSION=${PROJECT_VERSION}
          -DOUTPUT=${emit_version_dir}/emit/version.hpp
          -P ${PROJECT_SOURCE_DIR}/deploy/cmake/git_stamp_script.cmake
  BYPRODUCTS ${emit_version_dir}/emit/version.hpp VERBATIM)
add_library(emit_version INTERFACE)
target_include_directories(emit_version INTERFACE ${emit_version_dir})
add_dependencies(emit_version emit_version_stamp)
