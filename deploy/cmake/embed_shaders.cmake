# SPDX-License-Identifier: Apache-2.0
# emit_embed_shaders(TARGET target ROOT dir FILES relative...)
# Compiles the shader sources into TARGET as one table of (path, text); see gl/shader_source.hpp.
function(emit_embed_shaders)
  cmake_parse_arguments(arg "" "TARGET;ROOT" "FILES" ${ARGN})
  set(output "${CMAKE_CURRENT_BINARY_DIR}/embedded_shaders.cpp")
  set(depends "")
  foreach(file ${arg_FILES})
    list(APPEND depends "${arg_ROOT}/${file}")
  endforeach()
  set(generator "${PROJECT_SOURCE_DIR}/deploy/cmake/embed_shaders_script.cmake")
  string(REPLACE ";" "," files "${arg_FILES}")
  add_custom_command(OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DROOT=${arg_ROOT} -DFILES=${files} -DOUTPUT=${output} -P ${generator}
    DEPENDS ${depends} ${generator} VERBATIM)
  target_sources(${arg_TARGET} PRIVATE ${output})
endfunction()
