# SPDX-License-Identifier: Apache-2.0
"""The Protobuf messages of the wire format, which protoc made from protocol/proto/emit/v1."""
from __future__ import annotations

from google.protobuf.message import DecodeError

try:
    from emit.v1 import control_pb2, host_pb2, status_pb2
except ImportError as error:
    raise ImportError(
        "emit_client: no module emit.v1 beside it; make it by protoc --python_out from the .proto files, or use the"
        " folder share/emit/python of a build or an installation") from error

__all__ = ["DecodeError", "control_pb2", "host_pb2", "status_pb2"]
