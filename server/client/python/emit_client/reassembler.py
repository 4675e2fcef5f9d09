# SPDX-License-Identifier: Apache-2.0
"""Frames from UDP fragments (wire format, section 4), which may be lost, doubled, reordered or corrupt."""
from __future__ import annotations

import collections
import dataclasses
import struct

import numpy as np

from .crc32c import crc32c
from .errors import ProtocolError
from .frame_header import FLAG_BITS, FRAME_HEADER_BYTES, FrameHeader, parse_frame_header
from .frames import ReceivedFrame

FRAGMENT_HEADER_BYTES = 32
_HEAD = struct.Struct("<IBBHIIIHHq")
# The same fields as an array, for many datagrams at once.
_HEADS = np.dtype([("magic", "<u4"), ("version", "u1"), ("flags", "u1"), ("stream_id", "<u2"), ("frame_id", "<u4"),
                   ("byte_offset", "<u4"), ("total_bytes", "<u4"), ("payload_bytes", "<u2"), ("row", "<u2"),
                   ("sim_time_ns", "<i8")])
_MAGIC = 0x474D4645
_VERSION = 1
_FIRST, _LAST, _RESENT = 1, 2, 8
_WORD_BYTES = 4
_HEADER_WORDS = FRAME_HEADER_BYTES // _WORD_BYTES
# Largest distance, in frames, of a reordered fragment. After so many fragments in a row from farther behind, the
# sender is assumed to have started again.
_REORDER_WINDOW = 64
_RESYNC_COUNT = 16
# A wider gap in frame ids means that the sender started again; it is not counted as a loss.
_MAX_COUNTED_GAP = 65536


def _distance(a: int, b: int) -> int:
    """Returns how far frame id `a` is after `b`. Ids wrap."""
    return ((a - b + 0x80000000) & 0xFFFFFFFF) - 0x80000000


class _Slot:
    """Buffer and state of one frame in work."""

    __slots__ = ("frame_id", "total_bytes", "sim_time_ns", "data", "prefix_bytes", "arrived", "received_bytes",
                 "end_seen", "arrivals", "resent")

    def __init__(self, frame_id: int, total_bytes: int, sim_time_ns: int) -> None:
        self.frame_id = frame_id
        self.total_bytes = total_bytes
        self.sim_time_ns = sim_time_ns
        self.data = np.empty(total_bytes, np.uint8)
        self.prefix_bytes = 0  # number of bytes that arrived in order from the front
        # One entry per word. It is made when the first fragment comes out of order; until then the prefix says it all.
        self.arrived: np.ndarray | None = None
        self.received_bytes = 0
        self.end_seen = False
        self.arrivals = 0
        self.resent = 0

    def map(self) -> np.ndarray:
        if self.arrived is None:
            self.arrived = np.zeros(self.total_bytes // _WORD_BYTES, bool)
            self.arrived[:self.prefix_bytes // _WORD_BYTES] = True
        return self.arrived

    def complete(self) -> bool:
        return self.received_bytes == self.total_bytes


@dataclasses.dataclass(frozen=True)
class OpenFrame:
    """State of a frame in work that is not complete."""

    frame_id: int
    arrivals: int
    end_seen: bool  # its last byte has arrived, or a byte of a newer frame


class Reassembler:
    """Puts the frames of one stream together, in the order of their frame ids.

    A frame leaves as complete when its last byte arrives. It leaves as partial when a newer frame completes, when
    too many frames are open, or on flush(). With `wait_for_missing` a complete frame waits for older ones, which may
    still be requested, until they are complete or given up.
    """

    def __init__(self, stream_id: int, max_pixel_bytes: int, *, check_crc: bool = True, max_open: int = 2,
                 wait_for_missing: bool = False) -> None:
        self._stream_id = stream_id
        self._max_pixel_bytes = max_pixel_bytes
        self._check_crc = check_crc
        self._max_open = max_open
        self._wait_for_missing = wait_for_missing
        self._open: dict[int, _Slot] = {}
        self._ready: collections.deque[ReceivedFrame] = collections.deque()
        self._finished_id: int | None = None
        self._delivered_id: int | None = None
        self._far_behind = 0
        self._geometry: FrameHeader | None = None
        self.fragments: collections.Counter[str] = collections.Counter()  # datagrams by what became of them
        self.frames_unusable = 0
        self.resyncs = 0
        self.resent = 0

    def push(self, datagram) -> str:
        """Takes one datagram, a bytes-like object, and returns what became of it.

        "accepted" is the one good answer; "duplicate", "late" and "foreign" are no faults.
        """
        status = self._push(memoryview(datagram))
        self.fragments[status] += 1
        return status

    def push_joined(self, data: np.ndarray, segment_bytes: int) -> None:
        """Takes datagrams that the kernel joined (UDP_GRO): all have `segment_bytes`, the last one may be shorter."""
        count = len(data) // max(segment_bytes, 1)
        if count > 1 and self._push_in_order(data, segment_bytes, count):
            data = data[count * segment_bytes:]
            if len(data) == 0:
                return
        for begin in range(0, max(len(data), 1), max(segment_bytes, 1)):
            self.push(data[begin:begin + segment_bytes])

    def pop(self) -> ReceivedFrame | None:
        """Returns the next finished frame, or None."""
        return self._ready.popleft() if self._ready else None

    def flush(self) -> None:
        """Finishes every frame in work as partial, because the stream ended or fell silent."""
        for slot in self._oldest_first():
            self._finish(slot)

    def open_frames(self) -> list[OpenFrame]:
        """Returns the incomplete frames in work, oldest first."""
        slots = self._oldest_first()
        return [OpenFrame(slot.frame_id, slot.arrivals, slot.end_seen or slot is not slots[-1])
                for slot in slots if not slot.complete()]

    def missing(self, frame_id: int, tail: bool, most: int) -> list[tuple[int, int]]:
        """Returns the missing ranges of a frame in work: first byte and number of bytes, at most `most` of them.

        Without `tail` only ranges in front of bytes that arrived count, because the rest may be on its way.
        """
        slot = self._open.get(frame_id)
        if slot is None:
            return []
        edges = np.flatnonzero(np.diff(np.concatenate(([True], slot.map(), [True])).astype(np.int8)))
        ranges = [(int(begin) * _WORD_BYTES, int(end - begin) * _WORD_BYTES)
                  for begin, end in zip(edges[::2], edges[1::2])]
        if ranges and not tail and sum(ranges[-1]) == slot.total_bytes:
            ranges.pop()
        return ranges[:most]

    def give_up(self, frame_id: int) -> None:
        """Finishes a frame as it is, after the older ones."""
        slot = self._open.get(frame_id)
        if slot is not None:
            self._finish_older(frame_id)
            self._finish(slot)
            self._finish_complete()

    def _push(self, datagram: memoryview) -> str:
        if len(datagram) < FRAGMENT_HEADER_BYTES:
            return "short_input"
        magic, version, flags, stream_id, frame_id, offset, total, length, _, sim_time_ns = _HEAD.unpack_from(datagram)
        payload = len(datagram) - FRAGMENT_HEADER_BYTES
        if magic != _MAGIC:
            return "wrong_magic"
        if stream_id != self._stream_id:
            return "foreign"  # the port of a group carries other streams as well
        if version != _VERSION:
            return "wrong_version"
        if payload < length:
            return "short_input"
        if payload != length or payload == 0 or payload % _WORD_BYTES:
            return "bad_length"
        if total % _WORD_BYTES or total < 2 * FRAME_HEADER_BYTES + _WORD_BYTES:
            return "oversize"
        if offset % _WORD_BYTES or offset + payload > total:
            return "bad_offset"
        if bool(flags & _FIRST) != (offset == 0) or bool(flags & _LAST) != (offset + payload == total):
            return "inconsistent"
        slot = self._enter(frame_id, total, sim_time_ns)
        if isinstance(slot, str):
            return slot
        if offset == slot.prefix_bytes and slot.received_bytes == slot.prefix_bytes:
            if slot.arrived is not None:
                slot.arrived[offset // _WORD_BYTES:(offset + payload) // _WORD_BYTES] = True
            slot.prefix_bytes += payload
        else:
            words = slot.map()[offset // _WORD_BYTES:(offset + payload) // _WORD_BYTES]
            present = int(np.count_nonzero(words))
            if present:
                return "duplicate" if present == len(words) else "overlap"
            words[:] = True
            if offset == slot.prefix_bytes:
                slot.prefix_bytes += payload
        slot.data[offset:offset + payload] = np.frombuffer(datagram, np.uint8)[FRAGMENT_HEADER_BYTES:]
        slot.received_bytes += payload
        slot.arrivals += 1
        slot.end_seen = slot.end_seen or bool(flags & _LAST)
        if flags & _RESENT:
            slot.resent += 1
            self.resent += 1
        if slot.complete():
            self._complete(slot)
        return "accepted"

    def _push_in_order(self, data: np.ndarray, segment_bytes: int, count: int) -> bool:
        """Takes `count` joined datagrams at once if they are the next ones of a frame, in order."""
        payload = segment_bytes - FRAGMENT_HEADER_BYTES
        if payload < _WORD_BYTES or payload % _WORD_BYTES:
            return False
        heads = np.ndarray((count,), _HEADS, data, strides=(segment_bytes,))
        first = heads[0]
        offset, total = int(first["byte_offset"]), int(first["total_bytes"])
        end = offset + count * payload
        offsets = heads["byte_offset"]
        expected = np.arange(offset, end, payload, np.int64)
        flags = (expected == 0) * _FIRST + (expected + payload == total) * _LAST
        if not (total % _WORD_BYTES == 0 and offset % _WORD_BYTES == 0 and end <= total and
                total >= 2 * FRAME_HEADER_BYTES + _WORD_BYTES and (heads["magic"] == _MAGIC).all() and
                (heads["version"] == _VERSION).all() and (heads["frame_id"] == first["frame_id"]).all() and
                (heads["stream_id"] == self._stream_id).all() and (heads["total_bytes"] == total).all() and
                (heads["sim_time_ns"] == first["sim_time_ns"]).all() and (heads["payload_bytes"] == payload).all() and
                (offsets == expected).all() and (heads["flags"] & (_FIRST | _LAST | _RESENT) == flags).all()):
            return False
        slot = self._open.get(int(first["frame_id"]))
        if slot is None and offset == 0:
            entered = self._enter(int(first["frame_id"]), total, int(first["sim_time_ns"]))
            slot = None if isinstance(entered, str) else entered
        if (slot is None or slot.arrived is not None or slot.prefix_bytes != offset or slot.total_bytes != total or
                slot.sim_time_ns != int(first["sim_time_ns"])):
            return False
        slot.data[offset:end].reshape(count, payload)[:] = data[:count * segment_bytes].reshape(
            count, segment_bytes)[:, FRAGMENT_HEADER_BYTES:]
        slot.prefix_bytes = slot.received_bytes = end
        slot.arrivals += count
        slot.end_seen = end == total
        self.fragments["accepted"] += count
        if slot.complete():
            self._complete(slot)
        return True

    def _enter(self, frame_id: int, total_bytes: int, sim_time_ns: int) -> _Slot | str:
        """Returns the frame of a fragment, or the reason why the fragment is dropped."""
        if total_bytes - 3 * FRAME_HEADER_BYTES >= self._max_pixel_bytes:
            return "oversize"
        if self._finished_id is not None and _distance(frame_id, self._finished_id) <= 0:
            if _distance(frame_id, self._finished_id) > -_REORDER_WINDOW:
                return "late"
            self._far_behind += 1
            if self._far_behind < _RESYNC_COUNT:
                return "late"
            self.flush()
            self._finished_id = self._delivered_id = None
            self.resyncs += 1
        self._far_behind = 0
        slot = self._open.get(frame_id)
        if slot is None:
            if len(self._open) >= self._max_open:
                oldest = self._oldest_first()[0]
                if _distance(frame_id, oldest.frame_id) < 0:
                    return "late"
                self._finish(oldest)
                self._finish_complete()
                if self._finished_id is not None and _distance(frame_id, self._finished_id) <= 0:
                    return "late"  # a newer, complete frame has just left
            slot = self._open[frame_id] = _Slot(frame_id, total_bytes, sim_time_ns)
        if slot.total_bytes != total_bytes or slot.sim_time_ns != sim_time_ns:
            return "inconsistent"
        return slot

    def _oldest_first(self) -> list[_Slot]:
        if len(self._open) < 2:
            return list(self._open.values())
        base = next(iter(self._open))
        return sorted(self._open.values(), key=lambda slot: _distance(slot.frame_id, base))

    def _complete(self, slot: _Slot) -> None:
        if self._wait_for_missing and self._oldest_first()[0] is not slot:
            return
        self._finish_older(slot.frame_id)
        self._finish(slot)
        self._finish_complete()

    def _finish_older(self, frame_id: int) -> None:
        for slot in self._oldest_first():
            if _distance(slot.frame_id, frame_id) < 0:
                self._finish(slot)

    def _finish_complete(self) -> None:
        """Finishes the complete frames that waited for one that has left."""
        for slot in self._oldest_first():
            if not slot.complete():
                break
            self._finish(slot)

    def _identify(self, slot: _Slot) -> tuple[FrameHeader, bool] | None:
        """Returns the header of a frame, from either copy or from the frame before it, and whether it is its own."""
        words = slot.total_bytes // _WORD_BYTES
        complete = slot.complete()
        has_first = complete or bool(slot.map()[:_HEADER_WORDS].all())
        has_second = complete or bool(slot.map()[words - _HEADER_WORDS:].all())
        for has, begin in ((has_first, 0), (has_second, slot.total_bytes - FRAME_HEADER_BYTES)):
            if not has:
                continue
            try:
                header = parse_frame_header(slot.data[begin:begin + FRAME_HEADER_BYTES].tobytes())
            except ProtocolError:
                continue
            if not (self._fits(slot, header) and header.payload_bytes <= self._max_pixel_bytes and
                    header.sim_time_ns == slot.sim_time_ns):
                return None
            self._geometry = header
            return header, True
        last = self._geometry
        if has_first or has_second or last is None or not self._fits(slot, last):
            return None
        zeros = {field.name: 0 for field in dataclasses.fields(FrameHeader)}
        zeros.update(quantity=last.quantity, channel_kind=last.channel_kind, channel_index=last.channel_index,
                     width_px=last.width_px, height_px=last.height_px, band_lo_um=last.band_lo_um,
                     band_hi_um=last.band_hi_um, payload_bytes=last.payload_bytes, sim_time_ns=slot.sim_time_ns,
                     position_m=(0.0, 0.0, 0.0), world_from_body=(1.0, 0.0, 0.0, 0.0), encoding="raw")
        return FrameHeader(**zeros), False

    @staticmethod
    def _fits(slot: _Slot, header: FrameHeader) -> bool:
        return 0 <= slot.total_bytes - header.payload_bytes - 2 * FRAME_HEADER_BYTES < FRAME_HEADER_BYTES

    def _finish(self, slot: _Slot) -> None:
        del self._open[slot.frame_id]
        if self._finished_id is not None and (
                (slot.frame_id - self._finished_id - 1) & 0xFFFFFFFF) > _MAX_COUNTED_GAP:
            self.resyncs += 1
            self._delivered_id = None
        self._finished_id = slot.frame_id
        identified = self._identify(slot)
        if identified is None:
            self.frames_unusable += 1
            return
        header, known = identified
        lost_before = 0
        if self._delivered_id is not None:
            lost_before = (slot.frame_id - self._delivered_id - 1) & 0xFFFFFFFF
        self._delivered_id = slot.frame_id
        flags = FLAG_BITS["lost_before"] if lost_before else 0
        pixels = slot.data[FRAME_HEADER_BYTES:FRAME_HEADER_BYTES + header.payload_bytes].view("<f4")
        shape = (header.height_px, header.width_px)
        validity = None
        missing_px = 0
        if not slot.complete():
            arrived = slot.map()[_HEADER_WORDS:_HEADER_WORDS + pixels.size]
            missing_px = pixels.size - int(np.count_nonzero(arrived))
            if missing_px:
                flags |= FLAG_BITS["partial"]
                validity = arrived.reshape(shape)
                pixels[~arrived] = 0.0
        if missing_px == 0 and self._check_crc and not (known and crc32c(pixels) == header.payload_crc32c):
            flags |= FLAG_BITS["corrupt"]
        self._ready.append(ReceivedFrame(
            header.with_flags(flags), pixels.reshape(shape), missing_px, validity, known, lost_before, slot.resent))
