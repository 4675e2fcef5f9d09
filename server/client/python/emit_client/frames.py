# SPDX-License-Identifier: Apache-2.0
"""Received frames, and the counts that a client keeps of them."""
from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator

import numpy as np

from .errors import OverwrittenError
from .frame_header import FLAG_BITS, FrameHeader


@dataclasses.dataclass(slots=True)
class ReceivedFrame:
    """One frame. Its pixels are the caller's own, except those of a shared-memory frame in place."""

    header: FrameHeader  # with the flags partial, corrupt and lost_before as this client found
    pixels: np.ndarray  # float32, height x width; missing pixels are 0
    missing_px: int = 0  # number of pixels that a partial frame lacks
    validity: np.ndarray | None = None  # of a partial frame: height x width, True where the pixel arrived
    # False: both headers of a partial frame were lost. Only size, band, quantity, channel and sim_time_ns are known.
    header_known: bool = True
    frames_lost_before: int = 0  # UDP: sent between the frame handed out before and this one, and lost or unusable
    resent_fragments: int = 0  # UDP: number of fragments that came because this client asked again
    first_byte_ns: int = 0  # wall instant (TAI) when this client began to have the frame
    last_byte_ns: int = 0
    _intact: Callable[[], bool] | None = None

    def still_valid(self) -> bool:
        """Returns False when the daemon has overwritten the pixels since the frame was received.

        Call it after the last use of pixels in shared memory: results made of overwritten ones are void. It is
        always True for frames over TCP and UDP, and for copies.
        """
        return self._intact is None or self._intact()

    @contextlib.contextmanager
    def checked(self) -> Iterator[np.ndarray]:
        """Gives the pixels, and raises OverwrittenError at the end if the daemon has overwritten them meanwhile."""
        yield self.pixels
        if not self.still_valid():
            raise OverwrittenError(
                f"frame {self.header.frame_number}: the daemon overwrote its pixels while they were in use")

    def copy(self) -> ReceivedFrame:
        """Returns a frame with pixels of its own. Raises OverwrittenError if the daemon was faster."""
        with self.checked() as pixels:
            out = dataclasses.replace(self, pixels=pixels.copy(), _intact=None)
        return out


@dataclasses.dataclass(slots=True)
class ReceiveCounters:
    """Counts since the subscription. They have the meaning of emit::client::ReceiveCounters."""

    received: int = 0  # complete frames
    partial: int = 0  # frames delivered with missing pixels
    lost: int = 0  # frames that did not come and were not announced as skipped
    gaps: int = 0  # announced skips: frames with the flag gap_before
    skipped: int = 0  # frame numbers missing at announced skips, less those that were lost
    crc_errors: int = 0  # complete frames with a wrong checksum: flag corrupt
    os_drops: int = 0  # datagrams that the kernel dropped for want of buffer space
    bad_datagrams: int = 0
    foreign_datagrams: int = 0  # of other streams, or not from the daemon's address
    late: int = 0  # frames with the flag late
    repeated: int = 0  # frames with the flag repeated
    resend_requests: int = 0
    resent: int = 0  # fragments that came because they were asked for


class FrameAccount:
    """Counts that a client makes from the headers of its frames, over any transport."""

    def __init__(self) -> None:
        self.counters = ReceiveCounters()
        self.every_nth = 1
        self._run_id: int | None = None
        self._last_frame_number = 0

    def missing_before(self, header: FrameHeader) -> int:
        """Returns how many frames that this client wanted lie between the frame taken last and this one."""
        if header.run_id != self._run_id or header.frame_number <= self._last_frame_number:
            return 0
        return (header.frame_number - self._last_frame_number - 1) // self.every_nth

    def take(self, header: FrameHeader, lost_before: int = 0) -> None:
        """Takes a frame that is handed out. `lost_before` were sent before it and did not come, by their ids."""
        counters = self.counters
        counters.late += bool(header.flag_bits & FLAG_BITS["late"])
        counters.repeated += bool(header.flag_bits & FLAG_BITS["repeated"])
        gap = bool(header.flag_bits & FLAG_BITS["gap_before"])
        counters.gaps += gap
        missing = self.missing_before(header)
        counters.lost += lost_before
        unexplained = missing - min(missing, lost_before)
        if gap:
            counters.skipped += unexplained
        else:
            counters.lost += unexplained
        self._run_id = header.run_id
        self._last_frame_number = header.frame_number

    def take_unknown(self, lost_before: int) -> None:
        """Takes a frame whose number went with its header: the gap to the next one is this frame."""
        self.counters.lost += lost_before
        self._last_frame_number += (1 + lost_before) * self.every_nth
