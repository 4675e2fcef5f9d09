# SPDX-License-Identifier: Apache-2.0
# emit_module(NAME name SOURCES ... [PUBLIC libs...] [PRIVATE libs...])
# Static library emit_<name> with alias emit::<name>; public headers in ./include.
function(emit_module)
  cmake_parse_arguments(arg "" "NAME" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(emit_${arg_NAME} STATIC ${arg_SOURCES})
  add_library(emit::${arg_NAME} ALIAS emit_${arg_NAME})
  target_include_directories(emit_${arg_NAME} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/include)
  target_link_libraries(emit_${arg_NAME} PUBLIC ${arg_PUBLIC} PRIVATE emit_options ${arg_PRIVATE})
endfunction()
