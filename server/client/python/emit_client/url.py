# SPDX-License-Identifier: Apache-2.0
"""URLs of the daemon: tcp://host:port, udp://host:port and shm://name."""
from __future__ import annotations

import dataclasses
import re

from .errors import ArgumentError

_SOCKET_URL = re.compile(r"(tcp|udp)://(?:\[([^\[\]]+)\]|([^\[\]:/]+)):([0-9]{1,5})")
_SHM_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


@dataclasses.dataclass(frozen=True)
class Url:
    """Parts of a URL. The host of a shm URL is the name of the memory, and its port is 0."""

    scheme: str
    host: str
    port: int = 0


def parse_url(text: str) -> Url:
    """Parses tcp://host:port or udp://host:port. IPv6 addresses stand in brackets."""
    match = _SOCKET_URL.fullmatch(text)
    if match is None or not 1 <= int(match[4]) <= 65535:
        raise ArgumentError(f"'{text}': not tcp://host:port or udp://host:port")
    return Url(match[1], match[2] or match[3], int(match[4]))


def parse_frame_url(text: str) -> Url:
    """Parses the URL of a stream of frames, which may be shm://name too."""
    if text.startswith("shm://"):
        name = text.removeprefix("shm://")
        if _SHM_NAME.fullmatch(name) is None:
            raise ArgumentError(f"'{text}': not shm://name, a name as stream.shm takes it")
        return Url("shm", name)
    try:
        return parse_url(text)
    except ArgumentError:
        raise ArgumentError(f"'{text}': not tcp://host:port, udp://host:port or shm://name") from None
