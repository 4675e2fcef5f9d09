# SPDX-License-Identifier: Apache-2.0
# Misuse that the types must refuse: macro of units_misuse.cpp and the reason the compiler gives.
function(emit_compile_fail_test macro message)
  add_test(NAME unit.CompileFail.${macro}
    COMMAND ${CMAKE_COMMAND} -DCOMPILER=${CMAKE_CXX_COMPILER}
      -DSOURCE=${CMAKE_CURRENT_SOURCE_DIR}/compile_fail/units_misuse.cpp
      -DINCLUDE=${PROJECT_SOURCE_DIR}/renderer/physics/include -DMACRO=${macro}
      -DMESSAGE=${message}
      -P ${CMAKE_CURRENT_SOURCE_DIR}/compile_fail/check_compile_fail.cmake)
  set_tests_properties(unit.CompileFail.${macro} PROPERTIES LABELS unit TIMEOUT 60)
endfunction()
emit_compile_fail_test(EMIT_MISUSE_MIXED_SUM "no match for .operator\\+")
emit_compile_fail_test(EMIT_MISUSE_BARE_DOUBLE "no match for .operator\\+")
emit_compile_fail_test(EMIT_MISUSE_IMPLICIT "no match for .operator=")
emit_compile_fail_test(EMIT_MISUSE_TO_DOUBLE "cannot convert")
emit_compile_fail_test(EMIT_MISUSE_COMPARE "no match for .operator<")
