# SPDX-License-Identifier: Apache-2.0
"""Centroid of the hottest spot within a gate of an image."""
from __future__ import annotations

import dataclasses
import math

import numpy as np


@dataclasses.dataclass(frozen=True)
class Gate:
    """Square window of an image. Pixel (0, 0) is top left and has its centre at (0.5, 0.5)."""

    x_px: float
    y_px: float
    half_px: float

    def slices(self, shape: tuple[int, int]) -> tuple[slice, slice]:
        """Returns rows and columns of the gate within an image of that shape. They may be empty."""
        height, width = shape
        return (slice(max(0, math.floor(self.y_px - self.half_px)), min(height, math.ceil(self.y_px + self.half_px))),
                slice(max(0, math.floor(self.x_px - self.half_px)), min(width, math.ceil(self.x_px + self.half_px))))


@dataclasses.dataclass(frozen=True)
class Spot:
    """A spot that was found. The place is in pixels of the image."""

    x_px: float
    y_px: float
    extent_px: float  # square root of the number of pixels above the threshold
    contrast: float  # peak above the background, in standard deviations of the background


def find_hot_spot(image: np.ndarray, gate: Gate, least_contrast: float = 6.0,
                  threshold_frac: float = 0.15) -> Spot | None:
    """Returns the spot around the brightest pixel of the gate, or None where nothing stands out.

    The background is the median of the gate, and its standard deviation is 1.4826 times the median absolute
    deviation. The threshold is `threshold_frac` of the way from background to peak, and at least three standard
    deviations above the background. The spot is the connected set of pixels above it. Its centroid weighs pixels by
    their excess over the threshold, so that a pixel which enters the set has no weight yet.
    """
    rows, columns = gate.slices(image.shape)
    window = np.asarray(image[rows, columns], dtype=np.float64)
    if window.size == 0:
        return None
    background = float(np.median(window))
    deviation = 1.4826 * float(np.median(np.abs(window - background)))
    peak_at = np.unravel_index(int(np.argmax(window)), window.shape)
    excess = float(window[peak_at]) - background
    # A background without noise has no deviation. What is a billionth of the level is rounding.
    floor = max(deviation, 1e-9 * abs(background), np.finfo(np.float64).tiny)
    if not math.isfinite(excess) or excess < least_contrast * floor:
        return None
    over = window - (background + max(threshold_frac * excess, 3.0 * deviation))
    spot = _connected(over > 0.0, peak_at)
    weights = np.where(spot, over, 0.0)
    total = float(weights.sum())
    y, x = np.indices(window.shape)
    return Spot(columns.start + 0.5 + float((weights * x).sum()) / total,
                rows.start + 0.5 + float((weights * y).sum()) / total,
                math.sqrt(int(spot.sum())), excess / floor)


def _connected(mask: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Returns the set of pixels of the mask that touch the start by edges."""
    out = np.zeros_like(mask)
    out[start] = True
    count = 1
    while True:
        grown = out.copy()
        grown[1:] |= out[:-1]
        grown[:-1] |= out[1:]
        grown[:, 1:] |= out[:, :-1]
        grown[:, :-1] |= out[:, 1:]
        out = grown & mask
        now = int(out.sum())
        if now == count:
            return out
        count = now
