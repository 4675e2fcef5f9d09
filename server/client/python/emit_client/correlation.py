# SPDX-License-Identifier: Apache-2.0
"""Matching of a stored template by normalised cross-correlation."""
from __future__ import annotations

import dataclasses

import numpy as np

from .errors import ArgumentError


@dataclasses.dataclass(frozen=True)
class Match:
    """The best place of a template in an image."""

    x_px: float  # centre of the template; the first column of an image reaches from 0 to 1
    y_px: float
    correlation: float  # -1 to 1; 1: the image is the template times a positive factor, plus a constant
    at_edge: bool  # the peak lies at the edge of the search, so that the true one may lie outside


class Template:
    """A stored picture of a place, which is found again in others by normalised cross-correlation.

    The correlation at a shift is sum(t (w - mean w)) / (|t| |w - mean w|), where t is the template less its mean and
    w the window of the image. It does not change when the image is scaled or offset. The peak between pixels is that
    of the quadratic that fits the 3 x 3 values around the highest one best.
    """

    def __init__(self, pixels: np.ndarray) -> None:
        """Raises ArgumentError for a template that is smaller than 3 x 3 pixels, not finite, or without contrast."""
        pixels = np.asarray(pixels, dtype=np.float64)
        if pixels.ndim != 2 or min(pixels.shape) < 3:
            raise ArgumentError(f"a template has 3 x 3 pixels or more, not {'x'.join(map(str, pixels.shape))}")
        if not np.isfinite(pixels).all():
            raise ArgumentError("the template has pixels that are not finite")
        self._zero_mean = pixels - pixels.mean()
        self._norm = float(np.sqrt((self._zero_mean**2).sum()))
        if self._norm <= 1e-9 * max(1e-300, float(np.abs(pixels).sum())):
            raise ArgumentError("the template has no contrast")

    @property
    def shape(self) -> tuple[int, int]:
        return self._zero_mean.shape

    def correlations(self, image: np.ndarray) -> np.ndarray:
        """Returns the correlation for every place at which the template lies within the image.

        Row r and column c belong to the template with its top left pixel at (r, c). Windows without contrast have 0.
        Raises ArgumentError for an image that is smaller than the template.
        """
        image = np.asarray(image, dtype=np.float64)
        rows, columns = self.shape
        if image.ndim != 2 or image.shape[0] < rows or image.shape[1] < columns:
            raise ArgumentError(f"the image of {image.shape} pixels is smaller than the template of {self.shape}")
        # A constant offset changes nothing but keeps the sums small.
        image = image - image.mean()
        windows = np.lib.stride_tricks.sliding_window_view(image, self.shape)
        products = np.einsum("rcij,ij->rc", windows, self._zero_mean, optimize=True)
        count = rows * columns
        mean = _window_sums(image, self.shape) / count
        power = _window_sums(image**2, self.shape) - count * mean**2
        scale = self._norm * np.sqrt(np.maximum(power, 0.0))
        floor = 1e-9 * self._norm * float(np.sqrt((image**2).sum()))
        return np.where(scale > floor, products / np.maximum(scale, np.finfo(np.float64).tiny), 0.0)

    def find(self, image: np.ndarray) -> Match:
        """Returns the best place of the template. Raises ArgumentError as correlations() does."""
        values = self.correlations(image)
        row, column = np.unravel_index(int(np.argmax(values)), values.shape)
        at_edge = not (0 < row < values.shape[0] - 1 and 0 < column < values.shape[1] - 1)
        x, y = (0.0, 0.0) if at_edge else _quadratic_peak(values[row - 1:row + 2, column - 1:column + 2])
        return Match(float(column) + x + self.shape[1] / 2, float(row) + y + self.shape[0] / 2,
                     float(values[row, column]), at_edge)


def _window_sums(image: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    sums = np.zeros((image.shape[0] + 1, image.shape[1] + 1))
    sums[1:, 1:] = image.cumsum(axis=0).cumsum(axis=1)
    rows, columns = shape
    return sums[rows:, columns:] - sums[:-rows, columns:] - sums[rows:, :-columns] + sums[:-rows, :-columns]


def _quadratic_peak(values: np.ndarray) -> tuple[float, float]:
    """Returns x and y of the maximum of the quadratic closest to 3 x 3 values, as seen from the middle one."""
    x, y = np.array([-1.0, 0.0, 1.0]), np.array([[-1.0], [0.0], [1.0]])
    slope_x = float((values * x).sum()) / 6
    slope_y = float((values * y).sum()) / 6
    curve_x = float((values * (3 * x**2 - 2)).sum()) / 3
    curve_y = float((values * (3 * y**2 - 2)).sum()) / 3
    twist = float((values * x * y).sum()) / 4
    determinant = curve_x * curve_y - twist**2
    if curve_x >= 0 or curve_y >= 0 or determinant <= 0:
        return 0.0, 0.0
    # The gradient of the quadratic is 0 at its peak.
    peak_x = (twist * slope_y - curve_y * slope_x) / determinant
    peak_y = (twist * slope_x - curve_x * slope_y) / determinant
    return min(max(peak_x, -1.0), 1.0), min(max(peak_y, -1.0), 1.0)
