# SPDX-License-Identifier: Apache-2.0
# The Python package emit_client, its examples, and the messages that protoc makes for it. They lie at
# share/emit/python in the build tree as when installed, so that PYTHONPATH=PREFIX/share/emit/python is right for both.
set(python_dir ${EMIT_SHARE_DIR}/python)
set(python_files)
set(python_sources
  emit_client/__init__.py
  emit_client/control.py
  emit_client/correlation.py
  emit_client/crc32c.py
  emit_client/deadline.py
  emit_client/errors.py
  emit_client/frame_client.py
  emit_client/frame_header.py
  emit_client/frames.py
  emit_client/host_client.py
  emit_client/host_frames.py
  emit_client/hot_spot.py
  emit_client/messages.py
  emit_client/reassembler.py
  emit_client/resend_planner.py
  emit_client/security.py
  emit_client/seeker.py
  emit_client/server_info.py
  emit_client/session_host.py
  emit_client/shm_frame_client.py
  emit_client/socket_frame_client.py
  emit_client/tcp_frame_client.py
  emit_client/tracker_study.py
  emit_client/udp_frame_client.py
  emit_client/url.py
  examples/receive_frames.py
  examples/send_poses.py)
foreach(file IN LISTS python_sources)
  add_custom_command(OUTPUT ${python_dir}/${file}
    COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_CURRENT_SOURCE_DIR}/python/${file} ${python_dir}/${file}
    DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/python/${file}
    COMMENT "Copying ${file}" VERBATIM)
  list(APPEND python_files ${python_dir}/${file})
endforeach()

set(proto_dir ${PROJECT_SOURCE_DIR}/protocol/proto)
set(proto_files emit/v1/control.proto emit/v1/host.proto emit/v1/status.proto)
set(proto_paths ${proto_files})
list(TRANSFORM proto_paths PREPEND ${proto_dir}/)
set(message_modules ${proto_files})
list(TRANSFORM message_modules REPLACE "\\.proto$" "_pb2.py")
list(TRANSFORM message_modules PREPEND ${python_dir}/)
file(MAKE_DIRECTORY ${python_dir})
add_custom_command(OUTPUT ${message_modules}
  COMMAND protobuf::protoc --proto_path=${proto_dir} --python_out=${python_dir} ${proto_files}
  DEPENDS ${proto_paths} protobuf::protoc
  COMMENT "Generating Protobuf messages for Python" VERBATIM)
add_custom_target(emit_client_python ALL DEPENDS ${python_files} ${message_modules})

set(python_install_dir ${CMAKE_INSTALL_DATADIR}/emit/python)
foreach(file IN LISTS python_sources)
  cmake_path(GET file PARENT_PATH folder)
  if(folder STREQUAL examples)
    install(PROGRAMS python/${file} DESTINATION ${python_install_dir}/${folder} COMPONENT client)
  else()
    install(FILES python/${file} DESTINATION ${python_install_dir}/${folder} COMPONENT client)
  endif()
endforeach()
install(FILES ${message_modules} DESTINATION ${python_install_dir}/emit/v1 COMPONENT client)
