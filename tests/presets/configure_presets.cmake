# SPDX-License-Identifier: Apache-2.0
# Configures the presets that nobody builds every day, so that a change cannot break them unseen.
# Usage: cmake -D SOURCE=... -D BINARY=... -P configure_presets.cmake
set(presets asan-ubsan tsan)
find_program(clang clang++)
if(clang)
  list(APPEND presets fuzz)
else()
  message("clang++ is not installed, so the preset fuzz is left out")
endif()
foreach(preset IN LISTS presets)
  execute_process(COMMAND ${CMAKE_COMMAND} --preset ${preset} -B ${BINARY}/${preset}
    WORKING_DIRECTORY ${SOURCE} OUTPUT_QUIET ERROR_VARIABLE text RESULT_VARIABLE code)
  file(REMOVE_RECURSE ${BINARY}/${preset})
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "cmake --preset ${preset} fails:\n${text}")
  endif()
endforeach()
