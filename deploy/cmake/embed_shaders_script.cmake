# SPDX-License-Identifier: Apache-2.0
cmake_minimum_required(VERSION 3.25)
# Run by emit_embed_shaders: writes OUTPUT from the FILES (comma separated) under ROOT.
string(REPLACE "," ";" files "${FILES}")
file(WRITE ${OUTPUT} "// Generated from ${ROOT}; do not edit.\n#include \"gl/shader_source.hpp\"\n\nnamespace emit::gl {\nnamespace {\nconstexpr EmbeddedShader kShaders[] = {\n")
foreach(file ${files})
  file(READ "${ROOT}/${file}" text)
  file(APPEND ${OUTPUT} "{\"${file}\", R\"__glsl(${text})__glsl\"},\n")
endforeach()
file(APPEND ${OUTPUT} "};\n}  // namespace\nstd::span<const EmbeddedShader> embedded_shaders() { return kShaders; }\n}  // namespace emit::gl\n")
