# SPDX-License-Identifier: Apache-2.0
"""Descriptions that the daemon gives of itself and its channels, and its answers."""
from __future__ import annotations

import dataclasses
import enum

from .messages import control_pb2, status_pb2

PROTOCOL_VERSION = 1
MAX_EVERY_NTH = 1000


class StatusCode(enum.IntEnum):
    """Codes of the daemon's answers (wire format, section 5)."""

    UNSPECIFIED = 0
    OK = 1
    WRONG_VERSION = 2
    OVERSIZE = 3
    MALFORMED = 4
    UNKNOWN_ENTITY = 5
    INVALID_POSE = 6
    TIME_BACKWARDS = 7
    DUPLICATE_FRAME = 8
    UNKNOWN_CHANNEL = 9
    NOT_ALLOWED = 10
    OVERLOADED = 11
    INTERNAL = 12
    INVALID_ENVIRONMENT = 13
    INVALID_VIEW = 14
    INVALID_PART = 15
    UNKNOWN_PART = 16


@dataclasses.dataclass(frozen=True)
class Status:
    """One answer of the daemon."""

    code: int  # a StatusCode, or a plain number that a newer daemon knows
    text: str
    host_frame_number: int  # number of the host frame that it answers; 0: none
    count: int  # number of times that this code was counted since the start

    @property
    def ok(self) -> bool:
        return self.code == StatusCode.OK

    @staticmethod
    def of(message: status_pb2.Status) -> Status:
        try:
            code: int = StatusCode(message.code)
        except ValueError:
            code = message.code
        return Status(code, message.text, message.host_frame_number, message.count)


@dataclasses.dataclass(frozen=True)
class Channel:
    """Description of one channel."""

    index: int
    name: str
    kind: str  # "injection" or "projector"
    sensor: str
    band: str
    band_lo_um: float
    band_hi_um: float
    width_px: int
    height_px: int
    every_nth: int  # shows frames 1, 1 + n, 1 + 2 n, ... of every run
    window_x_px: int
    window_y_px: int
    sensor_width_px: int  # 0: the daemon does not say
    sensor_height_px: int
    # Pairs of wavelength (um) and relative response. Empty: a perfect rectangle. None: the daemon does not say.
    response: tuple[tuple[float, float], ...] | None
    window_width_px: int  # size of the part of the sensor's image that the frames show
    window_height_px: int
    output_step_bits: int  # what is done to the pixels, as in FrameHeader
    look_ahead_frames: int = 0  # shows the scene so many frames later, as predicted

    def sensor_point(self, x_px: float, y_px: float) -> tuple[float, float] | None:
        """Returns the place in the sensor's image that a place of a frame shows.

        Both count in px from the top left corner; pixel (0, 0) has its centre at (0.5, 0.5). None: only the distortion
        map of the channel knows. A shift that the daemon has applied (FrameHeader.applied_shift_x_px) is not part of
        it: subtract it from the result.
        """
        if self.output_step_bits & 16:
            return None
        w, h = self.window_width_px, self.window_height_px
        quarter_turns = self.output_step_bits >> 2 & 3  # clockwise
        x, y = ((x_px, y_px), (y_px, h - x_px), (w - x_px, h - y_px), (w - y_px, x_px))[quarter_turns]
        if self.output_step_bits & 1:
            x = w - x
        if self.output_step_bits & 2:
            y = h - y
        return self.window_x_px + x, self.window_y_px + y

    @property
    def frame_bytes(self) -> int:
        return 4 * self.width_px * self.height_px

    @staticmethod
    def of(info: control_pb2.ChannelInfo) -> Channel:
        response: tuple[tuple[float, float], ...] | None = None
        if info.band_is_rectangle:
            response = ()
        elif info.response_um and len(info.response_um) == len(info.response_frac):
            response = tuple(zip(info.response_um, info.response_frac))
        return Channel(info.index, info.name, info.kind, info.sensor, info.band, info.band_lo_um, info.band_hi_um,
                       info.width_px, info.height_px, max(info.every_nth, 1), info.window_x_px, info.window_y_px,
                       info.sensor_width_px, info.sensor_height_px, response, info.window_width_px or info.width_px,
                       info.window_height_px or info.height_px, info.output_steps, info.look_ahead_frames)


@dataclasses.dataclass(frozen=True)
class ServerInfo:
    """Description of the daemon, received on connecting."""

    software: str
    scenario: str
    pacing: str  # "host-step", "ig-clock" or "trigger"
    device: str
    run_id: int
    tai_offset_unset: bool
    channels: tuple[Channel, ...]

    @staticmethod
    def of(welcome: control_pb2.Welcome) -> ServerInfo:
        return ServerInfo(welcome.software, welcome.scenario, welcome.pacing, welcome.device, welcome.run_id,
                          welcome.tai_offset_unset, tuple(Channel.of(each) for each in welcome.channels))
