# SPDX-License-Identifier: Apache-2.0
"""Matching errors of a correlation tracker whose templates come from several simulations (`emit engage`).

The folder holds pictures KIND_NN.npy of one camera at the same times: `truth`, and one for each model. Templates are
square windows on a grid. Every template is searched in the truth around its own place, so that the distance of the
match from there is the error.
"""
from __future__ import annotations

import argparse
import dataclasses
import json
import math
import pathlib
import sys

import numpy as np

from .correlation import Template
from .errors import ArgumentError

MODELS = ("thermal", "plain", "none")
LOST_PX = 2.0
# A window is a template if the smoothed truth changes from pixel to pixel by so many times the noise, in every direction.
LEAST_GRADIENT_TO_NOISE = 4.0
SMOOTHING_PX = 5


@dataclasses.dataclass(frozen=True)
class Windows:
    """Places of the templates: rows and columns of their top left pixels."""

    places: list[tuple[int, int]]
    template_px: int
    search_px: int


def least_gradient(window: np.ndarray) -> float:
    """Returns the RMS gradient of a window in the direction in which it is weakest, per pixel.

    It is the root of the smaller eigenvalue of the mean structure tensor. A window with one straight edge has none
    along the edge, and no tracker can tell where along the edge it lies.
    """
    down, right = np.gradient(window)
    xx, yy, xy = (right**2).mean(), (down**2).mean(), (right * down).mean()
    smaller = (xx + yy) / 2 - math.hypot((xx - yy) / 2, xy)
    return math.sqrt(max(smaller, 0.0))


def smoothed(image: np.ndarray, size_px: int) -> np.ndarray:
    """Returns the means of all squares of `size_px`, an odd number. Pixels near the border keep their values."""
    out = image.copy()
    half = size_px // 2
    squares = np.lib.stride_tricks.sliding_window_view(image, (size_px, size_px))
    out[half:image.shape[0] - half, half:image.shape[1] - half] = squares.mean(axis=(2, 3))
    return out


def choose_windows(truth: np.ndarray, template_px: int, search_px: int, noise: float) -> Windows:
    """Returns the windows of a grid, half a template apart, that a tracker could use in the first truth.

    The truth is smoothed for this, because the steps of a slanting edge from row to row would count as gradients along
    the edge.
    """
    truth = smoothed(truth, SMOOTHING_PX)
    step = max(1, template_px // 2)
    places = [(row, column)
              for row in range(search_px, truth.shape[0] - template_px - search_px + 1, step)
              for column in range(search_px, truth.shape[1] - template_px - search_px + 1, step)
              if least_gradient(truth[row:row + template_px, column:column + template_px])
              >= LEAST_GRADIENT_TO_NOISE * noise]
    return Windows(places, template_px, search_px)


def errors_of(windows: Windows, model: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the matching error in pixels and the correlation of every template of `model` in `truth`.

    A template without contrast cannot be found: its error is the radius of the search.
    """
    size, search = windows.template_px, windows.search_px
    errors, correlations = [], []
    for row, column in windows.places:
        area = truth[row - search:row + size + search, column - search:column + size + search]
        try:
            match = Template(model[row:row + size, column:column + size]).find(area)
        except ArgumentError:
            errors.append(float(search))
            correlations.append(0.0)
            continue
        centre = search + size / 2
        errors.append(math.hypot(match.x_px - centre, match.y_px - centre))
        correlations.append(match.correlation)
    return np.array(errors), np.array(correlations)


def main() -> int:
    parser = argparse.ArgumentParser(prog="emit_client.tracker_study", description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--pictures", type=int, required=True, help="number of times")
    parser.add_argument("--noise-w-m2-sr", type=float, required=True, help="standard deviation of the truth's noise")
    parser.add_argument("--template-px", type=int, default=32)
    parser.add_argument("--search-px", type=int, default=12)
    arguments = parser.parse_args()
    try:
        study(arguments)
    except (ArgumentError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def study(arguments: argparse.Namespace) -> None:
    def picture(kind: str, index: int) -> np.ndarray:
        return np.load(arguments.folder / f"{kind}_{index:02}.npy").astype(np.float64)
    windows = choose_windows(picture("truth", 0), arguments.template_px, arguments.search_px, arguments.noise_w_m2_sr)
    if not windows.places:
        raise ArgumentError("no window of the first picture has enough contrast for a template")
    for index in range(arguments.pictures):
        truth = picture("truth", index)
        truth += np.random.default_rng(index).normal(0.0, arguments.noise_w_m2_sr, truth.shape)
        for model in MODELS:
            for kind in ("predicted", "stored"):
                errors, correlations = errors_of(windows, picture(model, index if kind == "predicted" else 0), truth)
                print(json.dumps({
                    "model": model, "kind": kind, "index": index, "templates": len(windows.places),
                    "rms_px": float(np.sqrt((errors**2).mean())), "median_px": float(np.median(errors)),
                    "lost_frac": float((errors > LOST_PX).mean()), "correlation": float(correlations.mean())}),
                    flush=True)


if __name__ == "__main__":
    sys.exit(main())
