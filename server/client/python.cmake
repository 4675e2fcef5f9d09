# SPDX-License-Identifier: Apache-2.0
# The Python package emit_client, its examples, and the messages that protoc makes for it. They lie at
# share/emit/python in the build tree as when installed, so that PYTHONPATH=PREFIX/share/emit/python is right for both.
set(python_dir ${EMIT_SHARE_DIR}/python)
set(python_files)
file(GLOB python_sources CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}/python
  ${CMAKE_CURRENT_SOURCE_DIR}/python/emit_client/*.py ${CMAKE_CURRENT_SOURCE_DIR}/python/examples/*.py)
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
install(DIRECTORY python/emit_client python/examples DESTINATION ${python_install_dir} COMPONENT client
  USE_SOURCE_PERMISSIONS FILES_MATCHING PATTERN "*.py" PATTERN "__pycache__" EXCLUDE)
install(FILES ${message_modules} DESTINATION ${python_install_dir}/emit/v1 COMPONENT client)
