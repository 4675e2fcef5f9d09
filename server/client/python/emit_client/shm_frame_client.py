# SPDX-License-Identifier: Apache-2.0
"""Frames in shared memory (wire format, section 9).

The client waits by FUTEX_WAIT on the ring's signal, a system call through ctypes, so that it neither spins nor polls.
"""
from __future__ import annotations

import ctypes
import errno
import fcntl
import mmap
import os
import platform
import stat
import struct
import time

import numpy as np

from .control import check_version
from .crc32c import crc32c
from .errors import ArgumentError, ClosedError, ConnectError, ProtocolError, RefusedError
from .frame_client import FrameClient, StreamTerms, SubscribeOptions
from .frame_header import FLAG_BITS, FRAME_HEADER_BYTES, parse_frame_header
from .frames import ReceivedFrame
from .messages import DecodeError, control_pb2
from .server_info import MAX_EVERY_NTH, Channel, ServerInfo

_MAGIC = 0x534D4645
_VERSION = 2
_HEAD = struct.Struct("<IHxxIIQQQQQQq")
_HEAD_BYTES = 192
_SIGNAL_WORD, _STATE_WORD = 128 // 4, 132 // 4  # indices of 32-bit words
_NEWEST_WORD = 136 // 8  # index of a 64-bit word
_ENDED = 2
_CHANNEL = struct.Struct("<QQQ8x")
_MAX_CHANNELS = 1024
_SLOT_HEAD_BYTES = 64
_NO_FRAME = bytes(FRAME_HEADER_BYTES)

# Bytes of the object that stand for something when they are locked.
_MAKER_BYTE, _READER_BYTE = 0, 1
# Longest time until this client notices that the daemon is gone, because a crash wakes nobody.
_ALIVE_CHECK_NS = 100_000_000

_SYS_FUTEX = 202  # x86-64
_FUTEX_WAIT = 0
_libc = ctypes.CDLL(None, use_errno=True)


class _Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


def _futex_wait(address: int, expected: int, timeout_ns: int) -> None:
    """Sleeps while the word at the address holds `expected`, at most for the timeout. It may return early."""
    timeout = _Timespec(*divmod(timeout_ns, 1_000_000_000))
    result = _libc.syscall(ctypes.c_long(_SYS_FUTEX), ctypes.c_void_p(address), ctypes.c_int(_FUTEX_WAIT),
                           ctypes.c_uint32(expected), ctypes.byref(timeout), None, ctypes.c_int(0))
    if result != 0 and ctypes.get_errno() not in (errno.EAGAIN, errno.ETIMEDOUT, errno.EINTR):
        time.sleep(0.001)  # A sandbox may forbid the call, and returning at once would make the caller spin.


def _lock(byte: int, kind: int) -> bytes:
    return struct.pack("hhqqi4x", kind, os.SEEK_SET, byte, 1, 0)


class _Ring:
    """The mapped object. Nothing in it is trusted: every offset is checked when it is opened."""

    def __init__(self, name: str) -> None:
        self.path = f"/dev/shm/emitd-{name}"
        self._file: int | None = None
        self._memory: mmap.mmap | None = None
        try:
            self._file = os.open(self.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        except FileNotFoundError:
            raise ConnectError(f'{self.path}: no emitd on this host has stream.shm = "{name}"') from None
        except OSError as error:
            raise ConnectError(f"{self.path}: {error.strerror}") from error
        try:
            self._open()
        except OSError as error:
            self.close()
            if isinstance(error, ConnectError):
                raise
            raise ConnectError(f"{self.path}: {error.strerror}") from error
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        status = os.fstat(self._file)
        if not stat.S_ISREG(status.st_mode) or status.st_size == 0:
            raise ConnectError(f"{self.path}: not shared memory")
        if not self.alive():
            raise ConnectError(f"{self.path}: left behind by an emitd that is gone")
        # The daemon writes from here on.
        fcntl.fcntl(self._file, fcntl.F_OFD_SETLK, _lock(_READER_BYTE, fcntl.F_RDLCK))
        # Populated, so that no page fault falls into a frame.
        populate = getattr(mmap, "MAP_POPULATE", 0)
        self._memory = mmap.mmap(self._file, status.st_size, mmap.MAP_SHARED | populate, mmap.PROT_READ)
        self._bytes = np.frombuffer(self._memory, np.uint8)
        self._check()

    def _check(self) -> None:
        size = len(self._bytes)
        if size < _HEAD_BYTES:
            raise ProtocolError(f"{self.path}: too short for a ring of frames")
        (magic, version, self.slots, channels, total, self._slot_bytes, self._slots_offset, table, welcome,
         welcome_bytes, _) = _HEAD.unpack(self._bytes[:_HEAD.size].tobytes())
        if magic != _MAGIC:
            raise ProtocolError(f"{self.path}: not a ring of frames")
        if version != _VERSION:
            raise ProtocolError(f"{self.path}: ring version {version}, this reader knows {_VERSION}")
        if (total > size or self.slots < 3 or not 1 <= channels <= _MAX_CHANNELS or self._slots_offset % 64 or
                self._slot_bytes % 64 or self._slot_bytes < _SLOT_HEAD_BYTES or
                self._slots_offset + self.slots * self._slot_bytes > total or
                table + channels * _CHANNEL.size > total or welcome + welcome_bytes > total):
            raise ProtocolError(f"{self.path}: a ring of frames that contradicts itself")
        entries = self._bytes[table:table + channels * _CHANNEL.size].tobytes()
        self.channels = list(_CHANNEL.iter_unpack(entries))
        for header, pixels, pixel_bytes in self.channels:
            if (header < _SLOT_HEAD_BYTES or pixels % 64 or header + FRAME_HEADER_BYTES > self._slot_bytes or
                    pixels + pixel_bytes > self._slot_bytes):
                raise ProtocolError(f"{self.path}: a ring of frames with a channel outside its slots")
        self.welcome = self._bytes[welcome:welcome + welcome_bytes].tobytes()
        self._words = self._bytes[:_HEAD_BYTES].view("<u4")
        self._long_words = self._bytes[:_HEAD_BYTES].view("<u8")
        self._signal_address = self._bytes.ctypes.data + 4 * _SIGNAL_WORD
        first = self._slots_offset
        self._sequences = self._bytes[first:first + self.slots * self._slot_bytes].view("<u8")[::self._slot_bytes // 8]

    def alive(self) -> bool:
        """Returns whether the daemon still holds its lock."""
        answer = fcntl.fcntl(self._file, fcntl.F_OFD_GETLK, _lock(_MAKER_BYTE, fcntl.F_WRLCK))
        return struct.unpack_from("h", answer)[0] != fcntl.F_UNLCK

    def signal(self) -> int:
        return int(self._words[_SIGNAL_WORD])

    def ended(self) -> bool:
        return int(self._words[_STATE_WORD]) == _ENDED

    def newest(self) -> int:
        return int(self._long_words[_NEWEST_WORD])

    def intact(self, publication: int) -> bool:
        return int(self._sequences[publication % self.slots]) == 2 * publication

    def wait(self, seen: int, timeout_ns: int) -> None:
        _futex_wait(self._signal_address, seen, timeout_ns)

    def view(self, publication: int, channel: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns header and pixels of a channel in place."""
        header, pixels, pixel_bytes = self.channels[channel]
        begin = self._slots_offset + publication % self.slots * self._slot_bytes
        return (self._bytes[begin + header:begin + header + FRAME_HEADER_BYTES],
                self._bytes[begin + pixels:begin + pixels + pixel_bytes])

    def close(self) -> None:
        """Stops reading. Frames in place that somebody still holds keep the memory mapped."""
        if self._file is None:
            return
        # The mapping holds a descriptor of its own, with which the lock would live on.
        try:
            fcntl.fcntl(self._file, fcntl.F_OFD_SETLK, _lock(_READER_BYTE, fcntl.F_UNLCK))
        except OSError:
            pass
        os.close(self._file)
        self._file = None


class ShmFrameClient(FrameClient):
    """Reads frames where a daemon on this host writes them."""

    def __init__(self, name: str, check_crc: bool) -> None:
        super().__init__(check_crc)
        self._url = f"shm://{name}"
        if platform.machine() != "x86_64":
            # A reader must see header and pixels before it looks at the sequence again. Python has no fence for
            # that, and only x86-64 keeps the order of loads without one.
            raise ArgumentError(f"{self._url}: shared memory needs x86-64; take tcp:// or udp:// here")
        self._ring = _Ring(name)
        try:
            welcome = control_pb2.Welcome.FromString(self._ring.welcome)
            if len(welcome.channels) != len(self._ring.channels):
                raise ProtocolError(f"{self._url}: a ring without its welcome")
            check_version(welcome, self._url)
        except DecodeError as error:
            self._ring.close()
            raise ProtocolError(f"{self._url}: a ring without its welcome") from error
        except ProtocolError:
            self._ring.close()
            raise
        self.server = ServerInfo.of(welcome)
        self._options = SubscribeOptions()
        self._channel = 0
        self._publication = 0  # of the frame handed out last, or where reading began
        self._gap = False  # frames were overwritten before they were read
        self._alive_at_ns = 0

    def _close(self) -> None:
        self._ring.close()

    def _where(self) -> str:
        return self._url

    def _subscribe(self, options: SubscribeOptions, end_ns: int) -> Channel:
        wishes = (options.channel_name, options.channel_kind, options.sensor, options.band)
        for channel in self.server.channels:
            has = (channel.name, channel.kind, channel.sensor, channel.band)
            if all(wish in ("", each) for wish, each in zip(wishes, has)):
                break
        else:
            raise RefusedError("{}: no channel name '{}' kind '{}' sensor '{}' band '{}'".format(self._url, *wishes))
        if channel.every_nth > MAX_EVERY_NTH:
            raise ProtocolError(f"{self._url}: every_nth is {channel.every_nth}, must be 1 to {MAX_EVERY_NTH}")
        self._options = options
        self._channel = self.server.channels.index(channel)
        self._publication = self._ring.newest()
        self.terms = StreamTerms(every_nth=options.every_nth * channel.every_nth)
        return channel

    def _receive(self, end_ns: int) -> ReceivedFrame | None:
        ring = self._ring
        while True:
            # The signal is read before the look at the newest: what comes after this look changes it.
            seen = ring.signal()
            ended = ring.ended()
            newest = ring.newest()
            if newest > self._publication:
                # The slot behind the newest is being written; the one after it is next.
                if newest - self._publication >= ring.slots:
                    self._skip_to(newest - 1)
                taken = self._take(self._publication + 1)
                if isinstance(taken, ReceivedFrame):
                    return taken
                if taken == "overwritten":
                    self._skip_to(ring.newest() - 1)
                    if time.monotonic_ns() >= end_ns:
                        return None
                continue
            if ended:
                raise ClosedError(f"{self._url}: closed by the daemon")
            now_ns = time.monotonic_ns()
            if now_ns - self._alive_at_ns >= _ALIVE_CHECK_NS:
                if not ring.alive():
                    raise ClosedError(f"{self._url}: the daemon is gone without closing it")
                self._alive_at_ns = now_ns
            if now_ns >= end_ns:
                return None
            ring.wait(seen, min(end_ns - now_ns, _ALIVE_CHECK_NS))

    def _skip_to(self, publication: int) -> None:
        """Passes over everything up to this publication."""
        if self._options.every_frame:
            raise ClosedError(f"{self._url}: fell behind by more than the {self._ring.slots} frames it holds")
        self._gap = self._gap or publication > self._publication
        self._publication = max(self._publication, publication)

    def _take(self, publication: int) -> ReceivedFrame | str:
        """Returns the frame, or why there is none: "left_out" or "overwritten"."""
        ring = self._ring
        if not ring.intact(publication):
            return "overwritten"
        first_byte_ns = time.clock_gettime_ns(time.CLOCK_TAI)
        head, pixels = ring.view(publication, self._channel)
        raw = head.tobytes()
        if not ring.intact(publication):
            return "overwritten"
        if raw == _NO_FRAME:
            self._publication = publication
            return "left_out"
        header = parse_frame_header(raw)
        step = self.terms.every_nth
        # A frame that was late for its number comes under another one.
        if self._options.every_nth != 1 and header.frame_number % step != 1:
            self._publication = publication
            return "left_out"
        if header.payload_bytes != len(pixels):
            raise ProtocolError(f"{self._url}: a frame of another size than its channel")
        if not self._options.in_place:
            pixels = pixels.copy()
        last_byte_ns = time.clock_gettime_ns(time.CLOCK_TAI)
        corrupt = self._check_crc and crc32c(pixels) != header.payload_crc32c
        if not ring.intact(publication):
            return "overwritten"
        self._publication = publication
        flags = 0
        # Among the frames that were overwritten there may be none that this reader wanted.
        if (self._gap and step == 1) or self._account.missing_before(header) > 0:
            flags |= FLAG_BITS["gap_before"]
        self._gap = False
        if corrupt:
            self.counters.crc_errors += 1
            flags |= FLAG_BITS["corrupt"]
        header = header.with_flags(flags)
        self.counters.received += 1
        self._account.take(header)
        image = pixels.view("<f4").reshape(header.height_px, header.width_px)
        intact = (lambda: ring.intact(publication)) if self._options.in_place else None
        return ReceivedFrame(header, image, first_byte_ns=first_byte_ns, last_byte_ns=last_byte_ns, _intact=intact)
