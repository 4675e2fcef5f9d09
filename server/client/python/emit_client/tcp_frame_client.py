# SPDX-License-Identifier: Apache-2.0
"""Frames as records on the control connection."""
from __future__ import annotations

import time

from .control import RECORD_FRAME, Record
from .crc32c import crc32c
from .errors import ProtocolError
from .frame_client import SubscribeOptions
from .frame_header import FLAG_BITS, FRAME_HEADER_BYTES, parse_frame_header
from .frames import ReceivedFrame
from .server_info import Channel
from .socket_frame_client import SocketFrameClient


class TcpFrameClient(SocketFrameClient):
    """Receives frames over TCP."""

    def _subscribe(self, options: SubscribeOptions, end_ns: int) -> Channel:
        # Frames may follow the answer at once.
        self._connection.max_frame_bytes = self._largest_frame_bytes() + FRAME_HEADER_BYTES
        return self._take_terms(options, self._request(options, end_ns))

    def _receive(self, end_ns: int) -> ReceivedFrame | None:
        while True:
            record = self._connection.receive(end_ns)
            if record is None:
                return None
            if record.kind == RECORD_FRAME:
                return self._take_frame(record)
            self._take_control(record)

    def _take_frame(self, record: Record) -> ReceivedFrame:
        last_byte_ns = time.clock_gettime_ns(time.CLOCK_TAI)
        header = parse_frame_header(record.body)
        if header.encoding != "raw":
            raise ProtocolError(f"{self._where()}: frame {header.frame_number} has encoding {header.encoding}, which"
                                " was not asked for")
        if len(record.pixels) != header.payload_bytes:
            raise ProtocolError(f"{self._where()}: frame {header.frame_number} has {len(record.pixels)} bytes of"
                                f" pixels, its header says {header.payload_bytes}")
        if self._check_crc and crc32c(record.pixels) != header.payload_crc32c:
            self.counters.crc_errors += 1
            header = header.with_flags(FLAG_BITS["corrupt"])
        self.counters.received += 1
        self._account.take(header)
        pixels = record.pixels.view("<f4").reshape(header.height_px, header.width_px)
        return ReceivedFrame(header, pixels, first_byte_ns=record.first_byte_ns, last_byte_ns=last_byte_ns)
