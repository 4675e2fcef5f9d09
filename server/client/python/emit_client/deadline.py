# SPDX-License-Identifier: Apache-2.0
"""Deadlines on the monotonic clock, and waiting for descriptors until then."""
from __future__ import annotations

import select
import time

from .errors import ArgumentError

_MAX_TIMEOUT_S = 1e9


def deadline_ns(timeout_s: float) -> int:
    """Returns the monotonic instant at which the timeout ends. A timeout of 0 polls."""
    if not 0 <= timeout_s <= _MAX_TIMEOUT_S:
        raise ArgumentError(f"timeout_s is {timeout_s}, must be 0 to {_MAX_TIMEOUT_S:g}")
    return time.monotonic_ns() + int(timeout_s * 1e9)


def left_s(end_ns: int) -> float:
    return max(end_ns - time.monotonic_ns(), 0) / 1e9


def wait_for(events: dict[int, int], end_ns: int) -> dict[int, int]:
    """Sleeps until a descriptor is ready for its events. Returns the ready ones; none when the time is up."""
    poll = select.poll()
    for descriptor, mask in events.items():
        poll.register(descriptor, mask)
    # Rounded up, because a wait that ends too early would be repeated without sleeping.
    left_ms = -(-max(end_ns - time.monotonic_ns(), 0) // 1_000_000)
    return dict(poll.poll(left_ms))
