# SPDX-License-Identifier: Apache-2.0
# cmake -DCOMPILER=c++ -DSOURCE=x.cpp -DINCLUDE=dir -DMACRO=name -DMESSAGE=regex -P this
# The source must compile as it is and must fail with MACRO defined, for the stated reason.
set(command ${COMPILER} -std=c++20 -fsyntax-only -I${INCLUDE})
execute_process(COMMAND ${command} ${SOURCE} RESULT_VARIABLE good ERROR_VARIABLE log)
if(NOT good EQUAL 0)
  message(FATAL_ERROR "the correct variant does not compile:\n${log}")
endif()
execute_process(COMMAND ${CMAKE_COMMAND} -E env LC_ALL=C ${command} -D${MACRO} ${SOURCE}
  RESULT_VARIABLE bad ERROR_VARIABLE log)
if(bad EQUAL 0)
  message(FATAL_ERROR "${MACRO} compiles, but must not")
endif()
if(NOT log MATCHES "${MESSAGE}")
  message(FATAL_ERROR "${MACRO} fails for another reason than '${MESSAGE}':\n${log}")
endif()
