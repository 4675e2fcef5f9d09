# SPDX-License-Identifier: Apache-2.0
# emit_options: what every target of the project compiles with.
add_library(emit_options INTERFACE)
target_compile_options(emit_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast
  -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-align -Wimplicit-fallthrough
  # Results must not depend on whether the compiler found a multiply-add.
  -ffp-contract=off)
target_compile_definitions(emit_options INTERFACE GLM_FORCE_EXPLICIT_CTOR GLM_ENABLE_EXPERIMENTAL)
# g++ 12 reports overlapping copies where strings are joined (its bug 105329).
target_compile_options(emit_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
if(EMIT_UNITY_BUILD)
  # A source file counts as a header where several are compiled as one, so g++ takes its private types for shared ones.
  target_compile_options(emit_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
if(EMIT_PRECOMPILED_HEADERS)
  # g++ takes precompiled headers for the project's own, and version 12 reports std::string wrongly. Builds with
  # sanitizers have no precompiled headers and keep these warnings.
  target_compile_options(emit_options INTERFACE
    "$<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-stringop-overflow;-Wno-stringop-overread>")
endif()
if(EMIT_WARNINGS_AS_ERRORS)
  target_compile_options(emit_options INTERFACE -Werror)
endif()
if(EMIT_SANITIZE)
  # Contracts of innermost loops are checked too.
  target_compile_definitions(emit_options INTERFACE EMIT_DCHECKS)
  target_compile_options(emit_options INTERFACE -fsanitize=${EMIT_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  target_link_options(emit_options INTERFACE -fsanitize=${EMIT_SANITIZE})
  # g++ 12 reports false maybe-uninitialised reads in instrumented code.
  target_compile_options(emit_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endif()
