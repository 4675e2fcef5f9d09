# SPDX-License-Identifier: Apache-2.0
"""When a receiver asks for what it is missing (wire format, section 4, "Resend")."""
from __future__ import annotations

import dataclasses
import struct

from .reassembler import OpenFrame

MAX_RESEND_RANGES = 128
_SETTLE_NS = 500_000  # reordered fragments may still come
_QUIET_NS = 3_000_000
_ANSWER_NS = 20_000_000  # from a request to the next
_REQUESTS = 4  # per frame at most, without an answer


@dataclasses.dataclass(slots=True)
class Step:
    """The next step: "wait" until wake_ns (0: no frame is open), "ask" for a frame, or "give_up" a frame."""

    kind: str
    frame_id: int = 0
    wake_ns: int = 0
    tail: bool = False  # ask: what is behind the last byte that came, too


@dataclasses.dataclass(slots=True)
class _Watched:
    arrivals: int
    changed_ns: int
    asked_ns: int = 0
    asked: int = 0  # since anything came of it


class ResendPlanner:
    """Asks for a frame once nothing more came of it for a moment, again when no answer comes, and then gives it up.

    The moment is short when the end of the frame or a newer one was seen. Otherwise it is longer, and the first
    request is for the holes alone, because a sender that had to wait goes on.
    """

    def __init__(self) -> None:
        self._watched: dict[int, _Watched] = {}

    def next(self, frames: list[OpenFrame], now_ns: int) -> Step:
        """Returns the next step for the frames in work, oldest first. A request that it returns counts as sent."""
        ids = {frame.frame_id for frame in frames}
        self._watched = {frame_id: each for frame_id, each in self._watched.items() if frame_id in ids}
        wake_ns = 0
        for frame in frames:
            known = self._watched.get(frame.frame_id)
            if known is None:
                known = self._watched[frame.frame_id] = _Watched(frame.arrivals, now_ns)
            elif known.arrivals != frame.arrivals:
                known.arrivals = frame.arrivals
                known.changed_ns = now_ns
                known.asked = 0
            due_ns = known.changed_ns + (_SETTLE_NS if frame.end_seen else _QUIET_NS)
            if known.asked_ns:
                due_ns = max(due_ns, known.asked_ns + _ANSWER_NS)
            if now_ns < due_ns:
                wake_ns = due_ns if wake_ns == 0 else min(wake_ns, due_ns)
                continue
            if known.asked == _REQUESTS:
                return Step("give_up", frame.frame_id)
            tail = frame.end_seen or known.asked > 0
            known.asked += 1
            known.asked_ns = now_ns
            return Step("ask", frame.frame_id, tail=tail)
        return Step("wait", wake_ns=wake_ns)


def encode_resend(stream_id: int, frame_id: int, ranges: list[tuple[int, int]]) -> bytes:
    """Returns the body of a resend request (record kind 4)."""
    flat = [number for each in ranges for number in each]
    return struct.pack(f"<HHI{len(flat)}I", stream_id, len(ranges), frame_id, *flat)
