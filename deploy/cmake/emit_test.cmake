# SPDX-License-Identifier: Apache-2.0
find_package(GTest REQUIRED)
include(GoogleTest)
include(ProcessorCount)

# Tests spend their time in the libraries. Optimising their own code less takes a quarter off its compile time.
add_library(emit_test_options INTERFACE)
target_compile_options(emit_test_options INTERFACE $<$<CONFIG:Release>:-O1>)

# Paths that tests read by: the source tree, the build tree, the programs and the shipped data.
add_library(emit_test_paths INTERFACE)
target_include_directories(emit_test_paths INTERFACE ${PROJECT_SOURCE_DIR}/tests)
target_compile_definitions(emit_test_paths INTERFACE
  EMIT_TEST_SOURCE_DIR="${PROJECT_SOURCE_DIR}/tests"
  EMIT_TEST_BINARY_DIR="${PROJECT_BINARY_DIR}"
  EMIT_TEST_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}"
  EMIT_TEST_SHARE_DIR="${EMIT_SHARE_DIR}")

# Every test includes GoogleTest and the same parts of the standard library. They are compiled once.
if(EMIT_PRECOMPILED_HEADERS)
  set(emit_precompiled_source "${PROJECT_BINARY_DIR}/generated/test_headers.cpp")
  file(CONFIGURE OUTPUT "${emit_precompiled_source}" CONTENT "// Holds the precompiled headers of the tests.\n")
  add_library(emit_test_headers OBJECT "${emit_precompiled_source}")
  target_link_libraries(emit_test_headers PRIVATE emit_options emit_test_options GTest::gmock)
  target_precompile_headers(emit_test_headers PRIVATE
    <algorithm> <array> <cmath> <cstdint> <memory> <optional> <span> <string> <string_view> <utility> <vector>
    <gmock/gmock.h> <gtest/gtest.h>)
endif()

# emit_test(NAME name LABEL label SOURCES ... [SEPARATE ...] LIBS ... [SERIAL [BESIDE filter]] [TIMEOUT seconds])
# One GoogleTest executable; each TEST becomes a CTest case carrying the label.
# SERIAL runs its tests while no others run, except those that BESIDE names (a filter of GoogleTest): they take no fixed
# port and wait for no deadline.
# Long tests are named in tests/costs/costs.cmake.
# With EMIT_UNITY_BUILD a few sources at a time are compiled as one, as in emit_library. SEPARATE names those of SOURCES
# that define the same private names as others.
function(emit_test)
  cmake_parse_arguments(arg "SERIAL" "NAME;LABEL;TIMEOUT;BESIDE" "SOURCES;SEPARATE;LIBS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  add_executable(${arg_NAME} ${arg_SOURCES})
  target_link_libraries(${arg_NAME} PRIVATE emit_options emit_test_options emit_test_paths ${arg_LIBS} GTest::gmock GTest::gtest_main)
  if(EMIT_PRECOMPILED_HEADERS)
    target_precompile_headers(${arg_NAME} REUSE_FROM emit_test_headers)
  endif()
  set_target_properties(${arg_NAME} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/tests"
    UNITY_BUILD ${EMIT_UNITY_BUILD} UNITY_BUILD_BATCH_SIZE 12)
  set_source_files_properties(${arg_SEPARATE} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  set(properties LABELS ${arg_LABEL} TIMEOUT ${arg_TIMEOUT})
  set(filter)
  if(arg_BESIDE)
    gtest_discover_tests(${arg_NAME} TEST_PREFIX "${arg_LABEL}." TEST_FILTER "${arg_BESIDE}" PROPERTIES ${properties}
      DISCOVERY_TIMEOUT 60)
    set(filter TEST_FILTER "-${arg_BESIDE}")
  endif()
  if(arg_SERIAL)
    list(APPEND properties RUN_SERIAL TRUE)
  endif()
  gtest_discover_tests(${arg_NAME} TEST_PREFIX "${arg_LABEL}." ${filter} PROPERTIES ${properties}
    DISCOVERY_TIMEOUT 60)
endfunction()
