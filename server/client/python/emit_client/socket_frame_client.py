# SPDX-License-Identifier: Apache-2.0
"""Parts that the frame clients over TCP and UDP share."""
from __future__ import annotations

from .control import ControlConnection, Record, parse_control
from .errors import DeadlineError, ProtocolError, RefusedError
from .frame_client import FrameClient, StreamTerms, SubscribeOptions
from .messages import control_pb2
from .server_info import Channel, Status

_MAX_FRAME_BYTES = 1 << 30


class SocketFrameClient(FrameClient):
    """Subscribes on a control connection."""

    def __init__(self, connection: ControlConnection, check_crc: bool) -> None:
        super().__init__(check_crc)
        self._connection = connection
        self.server = connection.server
        self._stream_id = 0

    def _close(self) -> None:
        self._connection.close()

    def _where(self) -> str:
        return self._connection.where

    def _largest_frame_bytes(self) -> int:
        largest = max((channel.frame_bytes for channel in self.server.channels), default=0)
        if largest > _MAX_FRAME_BYTES:
            raise ProtocolError(f"{self._where()}: frames of more than {_MAX_FRAME_BYTES} bytes are refused")
        return largest

    def _request(self, options: SubscribeOptions, end_ns: int, **transport: object) -> control_pb2.Subscribed:
        """Sends the wishes and returns the daemon's answer, as far as it does not depend on the transport."""
        subscribe = control_pb2.Subscribe(
            channel_name=options.channel_name, channel_kind=options.channel_kind, sensor=options.sensor,
            band=options.band, every_frame=options.every_frame, every_nth=options.every_nth, **transport)
        self._connection.send_control(control_pb2.ControlRecord(subscribe=subscribe), end_ns)
        while True:
            record = self._connection.receive(end_ns)
            if record is None:
                raise DeadlineError(f"{self._where()}: no answer to the subscription within the timeout")
            answer = parse_control(record)
            if answer is not None and answer.HasField("status"):
                raise RefusedError(f"{self._where()}: subscription refused: {answer.status.text}")
            if answer is not None and answer.HasField("subscribed"):
                return answer.subscribed

    def _take_terms(self, options: SubscribeOptions, answer: control_pb2.Subscribed, **terms: object) -> Channel:
        channel = Channel.of(answer.channel)
        every_nth = max(answer.every_nth, 1)
        if every_nth != options.every_nth * channel.every_nth:
            raise ProtocolError(f"{self._where()}: this daemon cannot leave frames out (every_nth)")
        if options.channel_name and channel.name != options.channel_name:
            raise ProtocolError(f"{self._where()}: this daemon knows no channels by name: it offers '{channel.name}'"
                                f" for '{options.channel_name}'")
        if answer.compression != control_pb2.COMPRESSION_NONE:
            raise ProtocolError(f"{self._where()}: the daemon grants compression, which was not asked for")
        if answer.error_correction.parity_fragments:
            raise ProtocolError(f"{self._where()}: the daemon grants error correction, which was not asked for")
        self._stream_id = answer.stream_id
        self.terms = StreamTerms(every_nth=every_nth, **terms)
        return channel

    def _take_control(self, record: Record) -> None:
        message = parse_control(record)
        if message is not None and message.HasField("status"):
            self._statuses.append(Status.of(message.status))
