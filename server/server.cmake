# SPDX-License-Identifier: Apache-2.0
# emit::server: everything of the daemon but main(), linked by emitd, emit and the tests.
add_library(emit_server STATIC
  agents/canned_source.cpp
  agents/channel_table.cpp
  agents/conductor.cpp
  agents/conductor_input.cpp
  agents/journal_encode.cpp
  agents/receiver.cpp
  agents/receiver_session.cpp
  agents/receiver_udp.cpp
  agents/recorder.cpp
  agents/render_agent.cpp
  agents/renderer_source.cpp
  agents/runner.cpp
  agents/sender.cpp
  agents/sender_client.cpp
  app/daemon.cpp
  app/emitd_main.cpp
  app/replay.cpp
  app/sha256.cpp
  io/client_connection.cpp
  io/frame_client.cpp
  io/host_client.cpp
  io/recorder_client.cpp
  io/socket.cpp
  io/udp_batch.cpp
  io/udp_frame_receiver.cpp
  pacing/pose_track.cpp
  pacing/scenario_track.cpp
  rt/clock.cpp
  rt/doorbell.cpp
  telemetry/log.cpp)
add_library(emit::server ALIAS emit_server)
target_include_directories(emit_server PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(emit_server
  PUBLIC emit::physics emit::protocol emit::config emit::renderer emit::image fmt::fmt Threads::Threads
  PRIVATE spdlog::spdlog emit_options emit_version)

add_executable(emitd main.cpp)
target_link_libraries(emitd PRIVATE emit::server emit_options)
install(TARGETS emitd RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
