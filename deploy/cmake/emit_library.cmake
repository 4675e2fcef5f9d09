# SPDX-License-Identifier: Apache-2.0
# emit_library(NAME name INCLUDE dirs... [SOURCES files...] [PUBLIC libs...] [PRIVATE libs...])
# Adds the static library emit_<name> with the alias emit::<name>. Every folder of sources is one library, so that tests
# and fuzz targets link what they exercise. A folder of headers alone becomes an interface library.
function(emit_library)
  cmake_parse_arguments(arg "" "NAME" "INCLUDE;SOURCES;PUBLIC;PRIVATE" ${ARGN})
  set(target emit_${arg_NAME})
  if(arg_SOURCES)
    add_library(${target} STATIC ${arg_SOURCES})
    target_include_directories(${target} PUBLIC ${arg_INCLUDE})
    target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE emit_options ${arg_PRIVATE})
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE ${arg_INCLUDE})
    target_link_libraries(${target} INTERFACE ${arg_PUBLIC})
  endif()
  add_library(emit::${arg_NAME} ALIAS ${target})
endfunction()
