# SPDX-License-Identifier: Apache-2.0
"""Reference seeker: it tracks a target in radiance frames and answers every frame with a line of sight.

Run as a program (`python3 -m emit_client.seeker --url shm://NAME --focal-px F`), it prints one JSON object a line on
standard output: {"ready": true} when it is subscribed, then one answer for each frame, in order. The keys of an answer
stand in answer_of(). `emit engage --seeker COMMAND` runs any other program that prints such lines.
"""
from __future__ import annotations

import argparse
import json
import math
import pathlib
import sys
import time

import numpy as np

from .correlation import Template
from .errors import ArgumentError, ClosedError, EmitError
from .frame_client import FrameClient
from .frame_header import FrameHeader
from .hot_spot import Gate, find_hot_spot


def angles_of(x_px: float, y_px: float, width_px: int, height_px: int, focal_px: float) -> tuple[float, float]:
    """Returns azimuth (right positive) and elevation (up positive) of an image point against the optical axis, rad.

    The axis meets the middle of the image, and `focal_px` is the distance of the image plane in pixels.
    """
    x, y = x_px - width_px / 2, y_px - height_px / 2
    return math.atan2(x, focal_px), math.atan2(-y, math.hypot(focal_px, x))


class HotSpotTracker:
    """Follows a hot spot with a gate that fits its size. The gate begins in the middle of the image."""

    LEAST_HALF_PX = 12.0

    def __init__(self) -> None:
        self._gate: Gate | None = None

    def track(self, image: np.ndarray) -> tuple[float, float, float] | None:
        """Returns x and y of the spot in pixels of the image and its contrast; None where there is none."""
        if self._gate is None:
            self._gate = Gate(image.shape[1] / 2, image.shape[0] / 2, self.LEAST_HALF_PX)
        spot = find_hot_spot(image, self._gate)
        if spot is None:
            # The target may have left the gate, which therefore grows, up to the whole image. It grows slowly, because
            # a small target that is missed for a frame or two comes back where it was, and clutter may be brighter.
            self._gate = Gate(self._gate.x_px, self._gate.y_px, min(1.05 * self._gate.half_px, max(image.shape)))
            return None
        self._gate = Gate(spot.x_px, spot.y_px, max(self.LEAST_HALF_PX, 3.0 * spot.extent_px))
        return spot.x_px, spot.y_px, spot.contrast


class CorrelationTracker:
    """Follows a stored template. A template that fits badly is taken anew from the image, at the place last found."""

    LEAST_CORRELATION = 0.6
    REFRESH_BELOW = 0.97

    def __init__(self, template: np.ndarray | None = None, size_px: int = 40, search_px: int = 8) -> None:
        """Without a template the first one is cut from the middle of the first image."""
        self._template = None if template is None else Template(template)
        self._size_px = size_px
        self._search_px = search_px
        self._at: tuple[float, float] | None = None
        self._offset = (0.0, 0.0)  # of the aim point from the centre of the template

    def track(self, image: np.ndarray) -> tuple[float, float, float] | None:
        """Returns x and y of the aim point in pixels of the image and the correlation; None where nothing fits."""
        if self._at is None:
            self._at = (image.shape[1] / 2, image.shape[0] / 2)
        if self._template is None:
            self._cut(image)
        rows, columns = self._template.shape
        gate = Gate(*self._at, max(rows, columns) / 2 + self._search_px)
        row_slice, column_slice = gate.slices(image.shape)
        window = image[row_slice, column_slice]
        if window.shape[0] < rows or window.shape[1] < columns:
            return None
        match = self._template.find(window)
        if match.correlation < self.LEAST_CORRELATION:
            return None
        self._at = (column_slice.start + match.x_px + self._offset[0], row_slice.start + match.y_px + self._offset[1])
        if match.correlation < self.REFRESH_BELOW:
            self._cut(image)
        return *self._at, match.correlation

    def _cut(self, image: np.ndarray) -> None:
        """Cuts a template around the aim point, and keeps how far its centre lies from it."""
        size = min(self._size_px, *image.shape)
        left = min(max(round(self._at[0] - size / 2), 0), image.shape[1] - size)
        top = min(max(round(self._at[1] - size / 2), 0), image.shape[0] - size)
        try:
            self._template = Template(image[top:top + size, left:left + size])
        except ArgumentError:
            if self._template is None:
                raise
            return  # a part without contrast is no template; the old one stays
        self._offset = (self._at[0] - (left + size / 2), self._at[1] - (top + size / 2))


Tracker = HotSpotTracker | CorrelationTracker


def answer_of(header: FrameHeader, found: tuple[float, float, float] | None, focal_px: float,
              received_ns: int) -> dict[str, object]:
    """Returns the answer to a frame.

    found, quality: whether the target was found, and its contrast or correlation.
    x_px, y_px: the target in the sensor's image.
    azimuth_rad, elevation_rad: the target against the optical axis, right and up positive.
    received_ns, answered_ns: wall instants (TAI) of the frame's arrival and of this answer.
    """
    answer: dict[str, object] = {
        "frame_number": header.frame_number, "host_frame_number": header.host_frame_number,
        "sim_time_ns": header.sim_time_ns, "found": found is not None, "received_ns": received_ns}
    if found is not None:
        x_px, y_px = found[0] + header.window_x_px, found[1] + header.window_y_px
        azimuth_rad, elevation_rad = angles_of(x_px, y_px, header.sensor_width_px or header.width_px,
                                               header.sensor_height_px or header.height_px, focal_px)
        answer |= {"x_px": x_px, "y_px": y_px, "azimuth_rad": azimuth_rad, "elevation_rad": elevation_rad,
                   "quality": found[2]}
    answer["answered_ns"] = time.clock_gettime_ns(time.CLOCK_TAI)
    return answer


def follow(client: FrameClient, tracker: Tracker, focal_px: float, every_frame: bool = True) -> None:
    """Answers frames until the stream ends. Without `every_frame` the newest frame is answered and others are left."""
    for frame in client.frames(timeout_s=3600.0):
        while not every_frame and (newer := client.receive(0)) is not None:
            frame = newer
        image = frame.copy()
        found = tracker.track(image.pixels)
        print(json.dumps(answer_of(image.header, found, focal_px, frame.first_byte_ns)), flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(prog="emit_client.seeker", description=__doc__.split("\n")[0])
    parser.add_argument("--url", required=True, help="shm://NAME, or tcp://HOST:PORT of the control port")
    parser.add_argument("--channel", default="", help="name of the channel; default: the first one")
    parser.add_argument("--focal-px", type=float, required=True, help="distance of the image plane, pixels")
    parser.add_argument("--method", choices=("hot-spot", "correlation"), default="hot-spot")
    parser.add_argument("--template", type=pathlib.Path, help="correlation: .npy file; default: the first image's middle")
    parser.add_argument("--newest", action="store_true", help="answer the newest frame alone, as real time asks for")
    arguments = parser.parse_args()
    try:
        tracker: Tracker = HotSpotTracker()
        if arguments.method == "correlation":
            tracker = CorrelationTracker(None if arguments.template is None else np.load(arguments.template))
        with FrameClient.connect(arguments.url) as client:
            client.subscribe(channel_name=arguments.channel, every_frame=not arguments.newest)
            print(json.dumps({"ready": True}), flush=True)
            follow(client, tracker, arguments.focal_px, not arguments.newest)
    except (ClosedError, KeyboardInterrupt, BrokenPipeError):
        return 0  # the daemon or the reader of the answers has ended
    except (EmitError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
