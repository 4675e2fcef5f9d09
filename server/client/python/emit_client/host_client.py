# SPDX-License-Identifier: Apache-2.0
"""Sending poses and commands."""
from __future__ import annotations

import abc
import enum
import select
import socket
import time
from collections.abc import Sequence

from .control import RECORD_HOST_FRAME, ControlConnection, encode_record, parse_control
from .deadline import deadline_ns, wait_for
from .errors import ArgumentError, ClosedError, ConnectError, DeadlineError
from .host_frames import EntityState, Environment, HostFrame, Pose
from .messages import DecodeError, control_pb2, status_pb2
from .security import Security, read_first_key
from .server_info import ServerInfo, Status
from .url import parse_url

DEFAULT_TIMEOUT_S = 5.0
_MAX_DATAGRAM_BYTES = 65536


class Command(enum.IntEnum):
    """Commands of a host (wire format, section 1)."""

    START = 1
    STOP = 2
    HOLD = 3
    STEP = 4
    RESET = 5


class HostClient(abc.ABC):
    """Sends poses. udp://host:port is the host port of the daemon, for host frames alone; tcp://host:port is its
    control port, for host frames and commands. One thread per object. The object is a context manager.
    """

    server: ServerInfo | None = None  # TCP only

    def __init__(self) -> None:
        # Every run needs a larger run id than the last, because the daemon refuses poses that go back in time.
        self.run_id = time.time_ns()
        self.frame_number = 0  # of the host frame that send_pose() sent last
        self._closed = False

    @staticmethod
    def connect(url: str, timeout_s: float = DEFAULT_TIMEOUT_S, *, security: Security = Security()) -> HostClient:
        """Connects. Over UDP nothing is asked, so that a wrong port shows only when the second frame is sent; with
        `security.key_file` the daemon proves that it knows the key.

        Raises ArgumentError, ConnectError, DeadlineError, RefusedError, ProtocolError.
        """
        from .session_host import SessionUdpHost

        parsed = parse_url(url)
        end_ns = deadline_ns(timeout_s)
        if parsed.scheme == "tcp":
            return TcpHost(ControlConnection.open(parsed, control_pb2.Hello.ROLE_HOST, end_ns, security))
        if security.key_file:
            return SessionUdpHost(parsed.host, parsed.port, read_first_key(security.key_file), end_ns)
        if security.tls:
            raise ArgumentError("host datagrams with TLS need key_file: Python cannot export a key from a TLS"
                                " connection; or send over tcp://")
        return UdpHost(parsed.host, parsed.port)

    def send_pose(self, sim_time_ns: int, seeker: Pose, entities: Sequence[EntityState] = (),
                  environment: Environment | None = None, timeout_s: float = DEFAULT_TIMEOUT_S,
                  fov_h_rad: float | None = None,
                  gimbal_rad: tuple[float, float, float] | None = None) -> int:
        """Sends the next host frame of this client's run and returns its number."""
        self.frame_number += 1
        self.send(HostFrame(self.run_id, self.frame_number, sim_time_ns, seeker, entities, environment, fov_h_rad,
                            gimbal_rad), timeout_s)
        return self.frame_number

    def send(self, frame: HostFrame, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        """Sends a host frame. TCP waits up to the timeout for room; UDP sends one datagram."""
        self._check_open()
        self._send(frame.encode(), deadline_ns(timeout_s))

    def command(self, command: Command, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        """Sends a command, over TCP only. The answer comes through receive_status()."""
        raise ArgumentError("commands need a tcp:// connection")

    @abc.abstractmethod
    def receive_status(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> Status | None:
        """Returns the next answer of the daemon, or None when the timeout ran out; 0 polls.

        Only host frames that were refused or make no frame are answered, and commands.
        """

    def close(self) -> None:
        """Ends the connection."""
        if not self._closed:
            self._closed = True
            self._close()

    def __enter__(self) -> HostClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._closed:
            raise ClosedError("this host is closed")

    @abc.abstractmethod
    def _close(self) -> None: ...

    @abc.abstractmethod
    def _send(self, body: bytes, end_ns: int) -> None: ...


class TcpHost(HostClient):
    """A host on the control connection."""

    def __init__(self, connection: ControlConnection) -> None:
        super().__init__()
        self._connection = connection
        self.server = connection.server

    def command(self, command: Command, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        self._check_open()
        message = control_pb2.ControlRecord(command=control_pb2.Command(kind=int(Command(command))))
        self._connection.send_control(message, deadline_ns(timeout_s))

    def receive_status(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> Status | None:
        self._check_open()
        end_ns = deadline_ns(timeout_s)
        while True:
            record = self._connection.receive(end_ns)
            if record is None:
                return None
            message = parse_control(record)
            if message is not None and message.HasField("status"):
                return Status.of(message.status)

    def _close(self) -> None:
        self._connection.close()

    def _send(self, body: bytes, end_ns: int) -> None:
        self._connection.send(encode_record(RECORD_HOST_FRAME, body), end_ns)


class UdpHost(HostClient):
    """A host that sends datagrams."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__()
        self._where = f"udp {host}:{port}"
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except OSError as error:
            raise ConnectError(f"{self._where}: {error.strerror}") from error
        try:
            self._socket.setblocking(False)
            self._socket.connect(address)
        except OSError as error:
            self._socket.close()
            raise ConnectError(f"{self._where}: {error.strerror}") from error

    def receive_status(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> Status | None:
        self._check_open()
        end_ns = deadline_ns(timeout_s)
        while True:
            datagram = self._receive_datagram(end_ns)
            if datagram is None:
                return None
            status = parse_status(datagram)
            if status is not None:
                return status

    def _close(self) -> None:
        self._socket.close()

    def _send(self, body: bytes, end_ns: int) -> None:
        self._send_datagram(body, end_ns)

    def _send_datagram(self, datagram: bytes, end_ns: int) -> None:
        retried = False
        while True:
            try:
                self._socket.send(datagram)
                return
            except BlockingIOError:
                if not wait_for({self._socket.fileno(): select.POLLOUT}, end_ns):
                    raise DeadlineError(f"{self._where}: takes nothing within the timeout") from None
            except ConnectionRefusedError as error:
                # The report belongs to an earlier datagram and takes this call's place. If nobody listens, the next
                # call tells again.
                if retried:
                    raise ConnectError(f"{self._where}: nobody listens") from error
                retried = True
            except OSError as error:
                raise ClosedError(f"{self._where}: {error.strerror}") from error

    def _receive_datagram(self, end_ns: int) -> bytes | None:
        while True:
            try:
                return self._socket.recv(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                if not wait_for({self._socket.fileno(): select.POLLIN}, end_ns):
                    return None
            except ConnectionRefusedError as error:
                raise ConnectError(f"{self._where}: nobody listens") from error
            except OSError as error:
                raise ClosedError(f"{self._where}: {error.strerror}") from error


def parse_status(body: bytes) -> Status | None:
    try:
        return Status.of(status_pb2.Status.FromString(body))
    except DecodeError:
        return None
