# SPDX-License-Identifier: Apache-2.0
"""Client library of emitd, a real-time infrared image generator, for Python 3.11 with numpy and protobuf.

FrameClient receives radiance frames as numpy arrays over TCP, UDP or shared memory. HostClient sends poses, weather
and commands. Timeouts are in seconds. All exceptions derive from EmitError.
"""
from .crc32c import crc32c
from .errors import (ArgumentError, ClosedError, ConnectError, DeadlineError, EmitError, OverwrittenError,
                     ProtocolError, RefusedError)
from .frame_client import FrameClient, StreamTerms
from .frame_header import FLAG_NAMES, OUTPUT_STEP_NAMES, FrameHeader, parse_frame_header
from .frames import ReceiveCounters, ReceivedFrame
from .host_client import Command, HostClient
from .host_frames import EntityState, Environment, HostFrame, Pose, attitude
from .security import Security
from .server_info import Channel, ServerInfo, Status, StatusCode

__all__ = [
    "ArgumentError", "Channel", "ClosedError", "Command", "ConnectError", "DeadlineError", "EmitError", "EntityState",
    "Environment", "FLAG_NAMES", "FrameClient", "FrameHeader", "HostClient", "HostFrame", "OUTPUT_STEP_NAMES",
    "OverwrittenError", "Pose", "ProtocolError", "ReceiveCounters", "ReceivedFrame", "RefusedError", "Security",
    "ServerInfo", "Status", "StatusCode", "StreamTerms", "attitude", "crc32c", "parse_frame_header"
]
