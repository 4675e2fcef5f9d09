# SPDX-License-Identifier: Apache-2.0
"""Exceptions of the package. Every text names the address or file and what is wrong with it."""
from __future__ import annotations


class EmitError(Exception):
    """Base of all exceptions that this package raises."""


class ArgumentError(EmitError, ValueError):
    """The caller asks for something that makes no sense, such as a malformed URL."""


class ConnectError(EmitError, ConnectionError):
    """The daemon cannot be reached: nobody listens, the name is unknown, the memory does not exist."""


class ClosedError(EmitError, ConnectionError):
    """The connection has ended: the daemon stopped, was killed or disconnected this client."""


class DeadlineError(EmitError, TimeoutError):
    """Nothing came, or nothing could be sent, within the timeout."""


class ProtocolError(EmitError):
    """The peer sends what the wire format does not allow, or speaks another version of it."""


class RefusedError(ProtocolError):
    """The daemon answered with a status that refuses the request."""


class OverwrittenError(EmitError):
    """The daemon has overwritten a frame in shared memory while it was in use."""
