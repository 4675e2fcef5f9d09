# SPDX-License-Identifier: Apache-2.0
add_library(emit_server STATIC placeholder.cpp)
add_library(emit::server ALIAS emit_server)
target_include_directories(emit_server PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(emit_server PUBLIC emit::physics emit::protocol emit::config emit::renderer emit::image
  Boost::headers spdlog::spdlog Threads::Threads PRIVATE emit_options emit_version)
