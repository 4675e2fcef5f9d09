# SPDX-License-Identifier: Apache-2.0
# emit::client: sockets, and the client side of the wire protocol, for the tool, the tests and
# integrators' programs.
add_library(emit_client STATIC
  io/asio.cpp
  io/client_connection.cpp
  io/fault_injector.cpp
  io/fault_relay.cpp
  io/frame_client.cpp
  io/host_client.cpp
  io/http_get.cpp
  io/ip_address.cpp
  io/key_file.cpp
  io/lent_socket.cpp
  io/recorder_client.cpp
  io/resend_planner.cpp
  io/shm_frame_client.cpp
  io/shm_object.cpp
  io/socket.cpp
  io/socket_address.cpp
  io/tls_context.cpp
  io/tls_session.cpp
  io/udp_frame_receiver.cpp
  io/udp_session_host.cpp
  rt/clock.cpp
  rt/futex.cpp)
add_library(emit::client ALIAS emit_client)
target_include_directories(emit_client PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
# Asio's non-template half is compiled once, in io/asio.cpp. Public: whoever includes Asio has to
# agree on this.
target_compile_definitions(emit_client PUBLIC BOOST_ASIO_SEPARATE_COMPILATION BOOST_ASIO_NO_DEPRECATED)
target_link_libraries(emit_client
  PUBLIC emit::physics emit::protocol Threads::Threads
  PRIVATE emit::config fmt::fmt emit_options OpenSSL::SSL)

# emit::server: everything of the daemon but main(), linked by emitd, emit and the tests.
add_library(emit_server STATIC
  agents/canned_source.cpp
  agents/channel_table.cpp
  agents/conductor.cpp
  agents/conductor_input.cpp
  agents/conductor_trigger.cpp
  agents/host_sessions.cpp
  agents/journal_encode.cpp
  agents/receiver.cpp
  agents/receiver_access.cpp agents/receiver_connection.cpp
  agents/receiver_session.cpp
  agents/receiver_udp.cpp
  agents/older_journal.cpp
  agents/recorder.cpp
  agents/render_agent.cpp
  agents/renderer_source.cpp
  agents/resend_window.cpp
  agents/runner.cpp
  agents/sender.cpp
  agents/sender_client.cpp
  agents/shm_client.cpp
  agents/socket_client.cpp
  app/daemon.cpp
  app/daemon_telemetry.cpp
  app/emitd_main.cpp
  app/privileges.cpp
  app/replay.cpp
  app/scenario_hash.cpp
  app/service_notifier.cpp
  app/sha256.cpp
  io/trigger_port.cpp
  io/udp_batch.cpp
  pacing/pose_track.cpp
  pacing/scenario_track.cpp
  rt/doorbell.cpp
  rt/realtime.cpp
  telemetry/frame_trace.cpp
  telemetry/log.cpp
  telemetry/metrics_server.cpp
  telemetry/metrics_text.cpp
  telemetry/ptp_monitor.cpp
  telemetry/ptp_status.cpp
  telemetry/status_board.cpp)
add_library(emit::server ALIAS emit_server)
# g++ 12 sees null pointers inside Boost: in Asio's scheduler, in Beast and below its JSON reader.
set_source_files_properties(app/scenario_hash.cpp io/asio.cpp telemetry/metrics_server.cpp PROPERTIES
                            COMPILE_OPTIONS -Wno-null-dereference)
if(EMIT_SANITIZE MATCHES thread)
  # Asio's reference counts use fences, which the sanitizer does not model; each Asio context here
  # belongs to one thread.
  set_property(SOURCE io/asio.cpp io/socket.cpp io/socket_address.cpp telemetry/metrics_server.cpp
               APPEND PROPERTY COMPILE_OPTIONS -Wno-tsan)
endif()
target_include_directories(emit_server PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(emit_server
  PUBLIC emit::client emit::physics emit::protocol emit::config emit::renderer emit::image fmt::fmt Threads::Threads
  PRIVATE spdlog::spdlog emit_options emit_version)

add_executable(emitd main.cpp)
target_link_libraries(emitd PRIVATE emit::server emit_options)
install(TARGETS emitd RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
