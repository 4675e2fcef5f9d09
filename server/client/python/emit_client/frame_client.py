# SPDX-License-Identifier: Apache-2.0
"""Receiving frames."""
from __future__ import annotations

import abc
import dataclasses
from collections.abc import Iterator

from .control import ControlConnection
from .deadline import deadline_ns
from .errors import ArgumentError, ClosedError, DeadlineError
from .frames import FrameAccount, ReceiveCounters, ReceivedFrame
from .messages import control_pb2
from .security import Security
from .server_info import MAX_EVERY_NTH, Channel, ServerInfo, Status
from .url import parse_frame_url

DEFAULT_TIMEOUT_S = 5.0


@dataclasses.dataclass(frozen=True)
class SubscribeOptions:
    """Wishes of a subscription; FrameClient.subscribe() explains them."""

    channel_name: str = ""
    channel_kind: str = ""
    sensor: str = ""
    band: str = ""
    every_frame: bool = False
    every_nth: int = 1
    fragment_payload_bytes: int = 0
    multicast_group: str = ""
    udp_port: int = 0
    resend: bool = False
    in_place: bool = True


@dataclasses.dataclass(frozen=True)
class StreamTerms:
    """Terms that the daemon granted a subscription."""

    every_nth: int = 1  # of the daemon's frames: the requested step times the channel's own
    resend: bool = False
    udp_port: int = 0  # where this client receives; 0: not over UDP
    fragment_payload_bytes: int = 0  # UDP: payload of every fragment but the last; 0: not UDP, or an older daemon


class FrameClient(abc.ABC):
    """Receives frames over tcp://host:port, udp://host:port or shm://name.

    The port is the control port of the daemon, for UDP too: frames then come as datagrams to a port of this client.
    shm://name reads the memory of a daemon on this host, which neither knows nor waits for its readers.
    One thread per object. The object is a context manager, and iterating over it gives frames.
    """

    server: ServerInfo
    terms: StreamTerms

    def __init__(self, check_crc: bool) -> None:
        self._check_crc = check_crc
        self._account = FrameAccount()
        self._statuses: list[Status] = []
        self._subscribed = False
        self._closed = False

    @staticmethod
    def connect(url: str, timeout_s: float = DEFAULT_TIMEOUT_S, *, check_crc: bool = True,
                security: Security = Security()) -> FrameClient:
        """Connects and waits for the daemon's description. The time that the system takes to look a name up is extra.

        `check_crc=False` leaves the checksum of the pixels unchecked, which spares about 1 ms for 640x512 pixels.
        Wrong pixels then pass without the flag "corrupt"; headers are checked all the same.

        Raises ArgumentError (URL, files of `security`), ConnectError, DeadlineError, RefusedError, ProtocolError.
        """
        # The transports derive from this class, so they cannot be imported before it is defined.
        from .shm_frame_client import ShmFrameClient
        from .tcp_frame_client import TcpFrameClient
        from .udp_frame_client import UdpFrameClient

        parsed = parse_frame_url(url)
        end_ns = deadline_ns(timeout_s)
        if parsed.scheme == "shm":
            return ShmFrameClient(parsed.host, check_crc)
        connection = ControlConnection.open(parsed, control_pb2.Hello.ROLE_CLIENT, end_ns, security)
        if parsed.scheme == "tcp":
            return TcpFrameClient(connection, check_crc)
        return UdpFrameClient(connection, check_crc)

    def subscribe(self, *, channel_name: str = "", channel_kind: str = "", sensor: str = "", band: str = "",
                  every_frame: bool = False, every_nth: int = 1, fragment_payload_bytes: int = 0,
                  multicast_group: str = "", udp_port: int = 0, resend: bool = False, in_place: bool = True,
                  timeout_s: float = DEFAULT_TIMEOUT_S) -> Channel:
        """Subscribes, once, and returns the channel. `terms` then has what the daemon granted.

        channel_name, channel_kind ("injection" or "projector"), sensor, band: empty matches anything; the first
            channel that matches is taken.
        every_frame: no frame is skipped because this client is slow. Where it falls behind, the daemon disconnects
            it (tcp, udp), or receive() raises ClosedError (shm).
        every_nth: 1 to 1000; only frames 1, 1 + n, 1 + 2 n, ... of every run. What is left out is no gap.
        fragment_payload_bytes: UDP; 0 leaves it to the daemon.
        multicast_group: UDP; empty means unicast.
        udp_port: UDP; 0 takes any free port.
        resend: UDP unicast, daemon in host-step; missing fragments are asked for again.
        in_place: shm; pixels are a read-only view of the daemon's memory, which is overwritten some frames later
            (ReceivedFrame.still_valid(), checked(), copy()). False copies them.

        Error correction and compressed pixels are never asked for, so no frame has them.
        Raises RefusedError with the daemon's text, ArgumentError, DeadlineError, ClosedError, ProtocolError.
        """
        self._check_open()
        if self._subscribed:
            raise ArgumentError("already subscribed")
        if not 1 <= every_nth <= MAX_EVERY_NTH:
            raise ArgumentError(f"every_nth is {every_nth}, must be 1 to {MAX_EVERY_NTH}")
        options = SubscribeOptions(channel_name, channel_kind, sensor, band, every_frame, every_nth,
                                   fragment_payload_bytes, multicast_group, udp_port, resend, in_place)
        channel = self._subscribe(options, deadline_ns(timeout_s))
        self._subscribed = True
        self._account.every_nth = self.terms.every_nth
        return channel

    def receive(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> ReceivedFrame | None:
        """Returns the next frame in order, or None when the timeout ran out first; 0 polls.

        Raises ClosedError when the connection ended and ProtocolError when the stream is broken. The client is of
        no further use after that.
        """
        if not self._subscribed:
            raise ArgumentError("subscribe comes before receive")
        self._check_open()
        return self._receive(deadline_ns(timeout_s))

    def frames(self, count: int | None = None, timeout_s: float = DEFAULT_TIMEOUT_S) -> Iterator[ReceivedFrame]:
        """Gives `count` frames, or frames without end. Raises DeadlineError when none comes within the timeout."""
        given = 0
        while count is None or given < count:
            frame = self.receive(timeout_s)
            if frame is None:
                raise DeadlineError(f"{self._where()}: no frame within {timeout_s:g} s")
            given += 1
            yield frame

    def __iter__(self) -> Iterator[ReceivedFrame]:
        return self.frames()

    @property
    def counters(self) -> ReceiveCounters:
        """Counts since the subscription. They are updated in place."""
        return self._account.counters

    def take_statuses(self) -> list[Status]:
        """Returns the answers that the daemon sent in between, oldest first, and forgets them."""
        out, self._statuses = self._statuses, []
        return out

    @property
    def receive_buffer_bytes(self) -> int:
        """Bytes that the kernel granted for UDP, in the unit of net.core.rmem_max; 0 for other transports."""
        return 0

    @property
    def receive_buffer_advice(self) -> str:
        """Empty when the buffer holds at least four frames; otherwise one line on how to raise the limit."""
        return ""

    def close(self) -> None:
        """Ends the subscription. Frames that were received stay valid, in shared memory until they are overwritten."""
        if not self._closed:
            self._closed = True
            self._close()

    def __enter__(self) -> FrameClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._closed:
            raise ClosedError(f"{self._where()}: closed by this client")

    @abc.abstractmethod
    def _close(self) -> None: ...

    @abc.abstractmethod
    def _where(self) -> str: ...

    @abc.abstractmethod
    def _subscribe(self, options: SubscribeOptions, end_ns: int) -> Channel: ...

    @abc.abstractmethod
    def _receive(self, end_ns: int) -> ReceivedFrame | None: ...
