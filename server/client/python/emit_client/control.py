# SPDX-License-Identifier: Apache-2.0
"""The control connection: records over TCP (wire format, sections 1 and 2), plain or within TLS."""
from __future__ import annotations

import dataclasses
import select
import socket
import ssl
import struct
import time

import numpy as np

from .deadline import left_s, wait_for
from .errors import ClosedError, ConnectError, DeadlineError, ProtocolError, RefusedError
from .frame_header import FRAME_HEADER_BYTES
from .messages import DecodeError, control_pb2
from .security import Security
from .server_info import PROTOCOL_VERSION, ServerInfo
from .url import Url

RECORD_CONTROL = 1
RECORD_FRAME = 2
RECORD_HOST_FRAME = 3
RECORD_RESEND = 4
MAX_CONTROL_BYTES = 1 << 20

_HEAD = struct.Struct("<IBBxxI")
_MAGIC = 0x43524D45
_VERSION = 1


def encode_record(kind: int, body: bytes) -> bytes:
    return _HEAD.pack(_MAGIC, _VERSION, kind, len(body)) + body


@dataclasses.dataclass(slots=True)
class Record:
    """One record. Of a frame record, `body` is the header, and `pixels` has the bytes behind it."""

    kind: int
    body: bytes
    pixels: np.ndarray | None
    first_byte_ns: int


def open_stream(url: Url, end_ns: int) -> socket.socket:
    """Connects to the first address of the host that answers. The socket does not block."""
    where = f"tcp {url.host}:{url.port}"
    try:
        addresses = socket.getaddrinfo(url.host, url.port, type=socket.SOCK_STREAM)
    except OSError as error:
        raise ConnectError(f"{where}: {error.strerror}") from error
    problem = "no address"
    for family, kind, protocol, _, address in addresses:
        stream = socket.socket(family, kind, protocol)
        try:
            # A timeout of 0 would mean "do not block", and connecting fails at once then.
            stream.settimeout(max(left_s(end_ns), 1e-3))
            stream.connect(address)
            stream.setblocking(False)
            stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return stream
        except TimeoutError:
            problem = "no answer within the timeout"
        except OSError as error:
            problem = error.strerror or str(error)
        stream.close()
    raise ConnectError(f"{where}: {problem}")


class ControlConnection:
    """Hello on opening, then records both ways. A record that is cut by a timeout goes on with the next call."""

    def __init__(self, stream: socket.socket, where: str) -> None:
        self._stream = stream
        self.where = where
        self.peer_ip: str = stream.getpeername()[0]
        self.local_address = stream.getsockname()
        self.family = stream.family
        self.max_frame_bytes = 0
        self.server: ServerInfo
        self._first_byte_ns = 0
        self._kind = 0
        self._length = 0
        self._header = b""
        self._expect(bytearray(_HEAD.size))
        self._part = self._take_head

    @staticmethod
    def open(url: Url, role: int, end_ns: int, security: Security) -> ControlConnection:
        context = security.context() if security.tls else None
        stream = open_stream(url, end_ns)
        try:
            where = f"tcp {url.host}:{url.port}"
            if context is not None:
                stream = _secure(stream, context, security.tls_name or url.host, where, end_ns)
            connection = ControlConnection(stream, where)
            connection._greet(role, end_ns)
            return connection
        except OSError as error:
            stream.close()
            if isinstance(error, (ClosedError, ConnectError, DeadlineError)):
                raise
            raise ConnectError(f"{where}: {error.strerror or error}") from error
        except BaseException:
            stream.close()
            raise

    def close(self) -> None:
        self._stream.close()

    def fileno(self) -> int:
        return self._stream.fileno()

    def has_pending(self) -> bool:
        """Returns True when bytes wait within TLS, which a poll of the descriptor does not show."""
        return isinstance(self._stream, ssl.SSLSocket) and self._stream.pending() > 0

    def receive(self, end_ns: int) -> Record | None:
        """Returns the next record, or None when the time is up."""
        while True:
            while self._filled < len(self._target):
                got = self._read_some(end_ns)
                if got == 0:
                    return None
                self._filled += got
            record = self._part()
            if record is not None:
                return record

    def send(self, data: bytes, end_ns: int) -> None:
        left = memoryview(data)
        while left:
            try:
                left = left[self._stream.send(left):]
                continue
            except (BlockingIOError, ssl.SSLWantWriteError):
                events = select.POLLOUT
            except ssl.SSLWantReadError:
                events = select.POLLIN
            except OSError as error:
                raise ClosedError(f"{self.where}: {error.strerror or error}") from error
            if not wait_for({self._stream.fileno(): events}, end_ns):
                raise DeadlineError(f"{self.where}: takes nothing within the timeout")

    def send_control(self, message: control_pb2.ControlRecord, end_ns: int) -> None:
        self.send(encode_record(RECORD_CONTROL, message.SerializeToString()), end_ns)

    def _greet(self, role: int, end_ns: int) -> None:
        hello = control_pb2.Hello(protocol_version=PROTOCOL_VERSION, software="emit_client for Python", role=role)
        self.send_control(control_pb2.ControlRecord(hello=hello), end_ns)
        record = self.receive(end_ns)
        if record is None:
            raise DeadlineError(f"{self.where}: no welcome within the timeout")
        answer = parse_control(record)
        if answer is not None and answer.HasField("status"):
            raise RefusedError(f"{self.where}: refused: {answer.status.text}")
        if answer is None or not answer.HasField("welcome"):
            raise ProtocolError(f"{self.where}: the first record is not a welcome")
        check_version(answer.welcome, self.where)
        self.server = ServerInfo.of(answer.welcome)

    def _expect(self, target) -> None:
        self._buffer = target
        self._target = memoryview(target).cast("B")
        self._filled = 0

    def _read_some(self, end_ns: int) -> int:
        while True:
            try:
                got = self._stream.recv_into(self._target[self._filled:])
            except (BlockingIOError, ssl.SSLWantReadError):
                events = select.POLLIN
            except ssl.SSLWantWriteError:
                events = select.POLLOUT
            except OSError as error:
                raise ClosedError(f"{self.where}: {error.strerror or error}") from error
            else:
                if got == 0:
                    between = self._part == self._take_head and self._filled == 0
                    raise ClosedError(f"{self.where}: connection closed{'' if between else ' within a record'}")
                if self._filled == 0 and self._part == self._take_head:
                    self._first_byte_ns = time.clock_gettime_ns(time.CLOCK_TAI)
                return got
            if not wait_for({self._stream.fileno(): events}, end_ns):
                return 0

    def _take_head(self) -> Record | None:
        magic, version, self._kind, self._length = _HEAD.unpack(self._buffer)
        if magic != _MAGIC:
            raise ProtocolError(f"{self.where}: stream broken: wrong magic {magic:#010x}: not a control port of emitd?")
        if version != _VERSION:
            raise ProtocolError(f"{self.where}: stream broken: record version {version}, this is version {_VERSION}")
        is_frame = self._kind == RECORD_FRAME
        if self._length > (self.max_frame_bytes if is_frame else MAX_CONTROL_BYTES):
            raise ProtocolError(f"{self.where}: stream broken: a record of {self._length} bytes is over its limit")
        if is_frame:
            if self._length < FRAME_HEADER_BYTES:
                raise ProtocolError(f"{self.where}: a frame record of {self._length} bytes has no frame header")
            self._expect(bytearray(FRAME_HEADER_BYTES))
            self._part = self._take_frame_header
        else:
            self._expect(bytearray(self._length))
            self._part = self._take_body
        return None

    def _take_frame_header(self) -> Record | None:
        self._header = bytes(self._buffer)
        self._expect(np.empty(self._length - FRAME_HEADER_BYTES, np.uint8))
        self._part = self._take_pixels
        return None

    def _take_pixels(self) -> Record | None:
        return self._finish(Record(self._kind, self._header, self._buffer, self._first_byte_ns))

    def _take_body(self) -> Record | None:
        return self._finish(Record(self._kind, bytes(self._buffer), None, self._first_byte_ns))

    def _finish(self, record: Record) -> Record:
        self._expect(bytearray(_HEAD.size))
        self._part = self._take_head
        return record


def parse_control(record: Record) -> control_pb2.ControlRecord | None:
    """Returns the message of a control record, or None for other kinds and for bodies that do not parse."""
    if record.kind != RECORD_CONTROL:
        return None
    try:
        return control_pb2.ControlRecord.FromString(record.body)
    except DecodeError:
        return None


def check_version(welcome: control_pb2.Welcome, where: str) -> None:
    if welcome.protocol_version != PROTOCOL_VERSION:
        raise ProtocolError(f"{where}: speaks protocol version {welcome.protocol_version}, this client"
                            f" {PROTOCOL_VERSION}")


def _secure(stream: socket.socket, context: ssl.SSLContext, name: str, where: str, end_ns: int) -> ssl.SSLSocket:
    secured = context.wrap_socket(stream, server_hostname=name, do_handshake_on_connect=False)
    while True:
        try:
            secured.do_handshake()
            return secured
        except ssl.SSLWantReadError:
            events = select.POLLIN
        except ssl.SSLWantWriteError:
            events = select.POLLOUT
        except OSError as error:  # ssl.SSLError is one
            secured.close()
            raise ConnectError(f"{where}: TLS: {error}") from error
        if not wait_for({secured.fileno(): events}, end_ns):
            secured.close()
            raise DeadlineError(f"{where}: TLS: no answer to the handshake within the timeout")
