# SPDX-License-Identifier: Apache-2.0
# Headers of the standard library, fmt and GLM are half of what the compiler reads. They are compiled once, which takes
# an eighth off the time of a first build.
if(EMIT_PRECOMPILED_HEADERS)
  set(emit_precompiled_source "${PROJECT_BINARY_DIR}/generated/library_headers.cpp")
  file(CONFIGURE OUTPUT "${emit_precompiled_source}" CONTENT "// Holds the precompiled headers of the libraries.\n")
  add_library(emit_library_headers OBJECT "${emit_precompiled_source}")
  target_link_libraries(emit_library_headers PRIVATE emit_options fmt::fmt)
  target_precompile_headers(emit_library_headers PRIVATE
    <algorithm> <array> <atomic> <bit> <chrono> <cmath> <cstddef> <cstdint> <cstring> <filesystem> <functional> <limits>
    <memory> <mutex> <numeric> <optional> <ranges> <span> <string> <string_view> <thread> <tuple> <utility> <variant>
    <vector> <fmt/format.h> <glm/geometric.hpp> <glm/gtc/quaternion.hpp> <glm/mat4x4.hpp> <glm/vec3.hpp>)
endif()

# emit_library(NAME name INCLUDE dirs... [SOURCES files...] [SEPARATE files...] [PUBLIC libs...] [PRIVATE libs...]
#   [COLD] [OWN_HEADERS])
# Adds the static library emit_<name> with the alias emit::<name>. Every folder of sources is one library, so that tests
# and fuzz targets link what they exercise. A folder of headers alone becomes an interface library.
# With EMIT_UNITY_BUILD a few sources of a library at a time are compiled as one, which halves the time of a first build.
# SEPARATE names those of SOURCES that define the same private names as others, so they are compiled alone.
# COLD marks libraries without numerical work and without part in a frame, such as command lines and readers of
# configurations. They are compiled with -O1, which takes about half the time of -O3.
# OWN_HEADERS marks libraries without precompiled headers: they lack fmt, or are compiled with -pthread.
function(emit_library)
  cmake_parse_arguments(arg "COLD;OWN_HEADERS" "NAME" "INCLUDE;SOURCES;SEPARATE;PUBLIC;PRIVATE" ${ARGN})
  set(target emit_${arg_NAME})
  list(TRANSFORM arg_INCLUDE REPLACE "(.+)" "$<BUILD_INTERFACE:\\1>")
  if(arg_SOURCES)
    add_library(${target} STATIC ${arg_SOURCES})
    set_target_properties(${target} PROPERTIES
      EXPORT_NAME ${arg_NAME} UNITY_BUILD ${EMIT_UNITY_BUILD} UNITY_BUILD_BATCH_SIZE 6)
    set_source_files_properties(${arg_SEPARATE} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    target_include_directories(${target} PUBLIC ${arg_INCLUDE})
    target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE $<BUILD_INTERFACE:emit_options> ${arg_PRIVATE})
    if(arg_COLD)
      target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
    elseif(EMIT_PRECOMPILED_HEADERS AND NOT arg_OWN_HEADERS)
      # Headers are compiled for one level of optimisation.
      target_precompile_headers(${target} REUSE_FROM emit_library_headers)
    endif()
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE ${arg_INCLUDE})
    target_link_libraries(${target} INTERFACE ${arg_PUBLIC})
  endif()
  add_library(emit::${arg_NAME} ALIAS ${target})
endfunction()
