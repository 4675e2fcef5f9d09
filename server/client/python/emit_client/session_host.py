# SPDX-License-Identifier: Apache-2.0
"""The host's end of authenticated datagrams (wire format, section 11)."""
from __future__ import annotations

import collections
import hashlib
import hmac
import secrets
import struct
import time

from .deadline import deadline_ns
from .errors import ArgumentError, ConnectError, DeadlineError
from .host_client import DEFAULT_TIMEOUT_S, UdpHost, parse_status
from .server_info import Status

_MAGIC = 0x53484D45
_VERSION = 1
_OPEN, _CHALLENGE, _HOST_FRAME, _ANSWER = 1, 2, 3, 4
_HEAD = struct.Struct("<IBBHQQQ")
_TAG_BYTES = 16
_NONCE_BYTES = 16
_MAX_PAYLOAD_BYTES = 65459
# Time between two questions whether the daemon still knows the session. A daemon that was started anew does not, and
# drops datagrams until the host asks.
_ASK_NS = 1_000_000_000
_RETRY_NS = 200_000_000  # until the first question is repeated
_MAX_STATUSES = 256


def derive(key: bytes, purpose: str, context: bytes = b"") -> bytes:
    """Returns KDF(key, purpose, context)."""
    return hashlib.blake2b(purpose.encode() + b"\0" + context, key=key, digest_size=32).digest()


def seal(key: bytes, kind: int, key_id: int, session_id: int, counter: int, payload: bytes = b"") -> bytes:
    """Returns a datagram with its MAC."""
    body = _HEAD.pack(_MAGIC, _VERSION, kind, 0, key_id, session_id, counter) + payload
    return body + hashlib.blake2b(body, key=key, digest_size=_TAG_BYTES).digest()


def is_genuine(key: bytes, datagram: bytes) -> bool:
    tag = hashlib.blake2b(datagram[:-_TAG_BYTES], key=key, digest_size=_TAG_BYTES).digest()
    return hmac.compare_digest(tag, datagram[-_TAG_BYTES:])


class SessionUdpHost(UdpHost):
    """Sends host frames with a MAC by a key that it shares with the daemon."""

    def __init__(self, host: str, port: int, key: bytes, end_ns: int) -> None:
        super().__init__(host, port)
        self._key = key
        self._open_key = derive(key, "emitd host open")
        self._key_id = int.from_bytes(derive(key, "emitd host key id")[:8], "little")
        self._session_id = secrets.randbits(64)
        self._session_key: bytes | None = None
        self._nonce = b""
        self._counter = 0
        self._echo = 0
        self._asked_ns = 0
        self._highest_answer = 0
        self._statuses: collections.deque[Status] = collections.deque()
        try:
            while self._session_key is None:
                self._ask()
                self._take_until(min(self._asked_ns + _RETRY_NS, end_ns), lambda: self._session_key is not None)
                if self._session_key is None and time.monotonic_ns() >= end_ns:
                    raise DeadlineError(f"{self._where}: no answer to the key: not one that the daemon knows, or no"
                                        " daemon there")
        except BaseException:
            self.close()
            raise

    def receive_status(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> Status | None:
        self._check_open()
        self._take_until(deadline_ns(timeout_s), lambda: bool(self._statuses))
        return self._statuses.popleft() if self._statuses else None

    def _send(self, body: bytes, end_ns: int) -> None:
        self._take_until(0, lambda: False)
        if time.monotonic_ns() - self._asked_ns >= _ASK_NS:
            self._ask()
        if len(body) > _MAX_PAYLOAD_BYTES:
            raise ArgumentError(f"host frame of {len(body)} bytes: at most {_MAX_PAYLOAD_BYTES} fit with a MAC")
        self._counter += 1
        self._transmit(seal(self._session_key, _HOST_FRAME, self._key_id, self._session_id, self._counter, body),
                       end_ns)

    def _ask(self) -> None:
        self._asked_ns = time.monotonic_ns()
        self._echo = secrets.randbits(64)
        self._transmit(seal(self._open_key, _OPEN, self._key_id, self._session_id, self._echo), self._asked_ns)

    def _transmit(self, datagram: bytes, end_ns: int) -> None:
        try:
            self._send_datagram(datagram, end_ns)
        except ConnectError:
            pass  # Nobody there now may mean a daemon that starts anew.

    def _take_until(self, end_ns: int, done) -> None:
        while not done():
            try:
                datagram = self._receive_datagram(end_ns)
            except ConnectError:
                continue  # The report is used up; a daemon that starts anew may listen soon.
            if datagram is None:
                return
            self._take(datagram)

    def _take(self, datagram: bytes) -> None:
        if len(datagram) < _HEAD.size + _TAG_BYTES:
            return
        magic, version, kind, _, key_id, session_id, counter = _HEAD.unpack_from(datagram)
        if (magic, version, key_id, session_id) != (_MAGIC, _VERSION, self._key_id, self._session_id):
            return
        payload = datagram[_HEAD.size:-_TAG_BYTES]
        if kind == _CHALLENGE:
            if len(payload) == _NONCE_BYTES + 1 and counter == self._echo and is_genuine(self._open_key, datagram):
                self._take_challenge(payload[:_NONCE_BYTES], payload[_NONCE_BYTES] == 1)
        elif kind == _ANSWER and self._session_key is not None and is_genuine(self._session_key, datagram):
            # Late answers are dropped; the daemon sends answers seldom, and in order.
            if counter > self._highest_answer:
                self._highest_answer = counter
                status = parse_status(payload)
                if status is not None and len(self._statuses) < _MAX_STATUSES:
                    self._statuses.append(status)

    def _take_challenge(self, nonce: bytes, known: bool) -> None:
        if self._session_key is not None:
            if known or nonce == self._nonce:
                return
            self._session_id = secrets.randbits(64)  # counters of a session are never used twice
        self._nonce = nonce
        self._counter = self._highest_answer = 0
        self._session_key = derive(self._key, "emitd host session", struct.pack("<Q", self._session_id) + nonce)
