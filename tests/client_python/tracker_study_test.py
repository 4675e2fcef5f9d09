# SPDX-License-Identifier: Apache-2.0
import contextlib
import io
import json
import pathlib
import tempfile
import unittest
from unittest import mock

import numpy as np
from emit_client import tracker_study
from emit_client.tracker_study import Windows, choose_windows, errors_of, least_gradient, smoothed


def blobs(shift_px=0.0, shape=(120, 140)):
    """Returns an image of 60 round spots that is shifted to the right by so many pixels."""
    generator = np.random.default_rng(11)
    y, x = np.indices(shape) + 0.5
    out = np.zeros(shape)
    for _ in range(60):
        at_x, at_y, radius = generator.uniform(0, 140), generator.uniform(0, 120), generator.uniform(2, 6)
        out += generator.uniform(-1, 1) * np.exp(-((x - at_x - shift_px)**2 + (y - at_y)**2) / (2 * radius**2))
    return 100 + out


class Windows32(unittest.TestCase):
    def test_the_weakest_gradient_is_that_along_an_edge(self):
        y, x = np.indices((32, 32)) + 0.5
        self.assertAlmostEqual(least_gradient(3 * x + 4 * y), 0.0, places=6)
        self.assertAlmostEqual(least_gradient(np.where(x < 16, 2.0 * x, 0.0) + np.where(x >= 16, 2.0 * y, 0.0)),
                               np.sqrt(2.0), delta=0.4)

    def test_windows_with_corners_are_chosen_and_those_with_edges_or_nothing_are_not(self):
        y, x = np.indices((128, 160))
        image = np.full((128, 160), 10.0)
        image[:, :40] = 20.0                                  # a straight edge
        image[40:70, 100:130] = 20.0                          # four corners
        image[y > x + 60] = 15.0                              # a slanting edge, far from the corners
        places = choose_windows(image, 32, 8, 0.05).places
        self.assertTrue(places)
        for row, column in places:
            window = image[row:row + 32, column:column + 32]
            self.assertGreater(len(np.unique(window)), 1)
            self.assertTrue(column + 32 > 96 or row + 32 > 56, (row, column))
        self.assertFalse(choose_windows(np.full((128, 160), 10.0), 32, 8, 0.05).places)

    def test_smoothing_keeps_means_and_the_border(self):
        image = np.random.default_rng(1).normal(0, 1, (20, 20))
        out = smoothed(image, 5)
        self.assertAlmostEqual(out[10, 7], image[8:13, 5:10].mean())
        self.assertEqual(out[0, 7], image[0, 7])


class Errors(unittest.TestCase):
    WINDOWS = Windows([(20, 20), (40, 60), (60, 90)], 32, 10)

    def test_a_shift_of_the_truth_is_the_error_of_every_template(self):
        errors, correlations = errors_of(self.WINDOWS, blobs(), blobs(3.25))
        for error, correlation in zip(errors, correlations, strict=True):
            self.assertAlmostEqual(error, 3.25, delta=0.1)
            self.assertGreater(correlation, 0.9)

    def test_a_template_without_contrast_has_the_radius_of_the_search(self):
        errors, correlations = errors_of(self.WINDOWS, np.full((120, 140), 5.0), blobs())
        self.assertTrue((errors == 10.0).all())
        self.assertTrue((correlations == 0.0).all())


class Program(unittest.TestCase):
    def run_study(self, folder, pictures=2):
        out, err = io.StringIO(), io.StringIO()
        arguments = ["x", "--folder", str(folder), "--pictures", str(pictures), "--noise-w-m2-sr", "0.001"]
        with mock.patch("sys.argv", arguments), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = tracker_study.main()
        return code, [json.loads(line) for line in out.getvalue().splitlines()], err.getvalue()

    def test_lines_tell_stored_from_predicted_templates(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for index in range(2):
                shift = 4.0 * index  # the truth moves between the pictures
                np.save(folder / f"truth_{index:02}.npy", blobs(shift).astype("<f4"))
                for model in ("thermal", "plain", "none"):
                    # Only the thermal model knows of it.
                    np.save(folder / f"{model}_{index:02}.npy",
                            blobs(shift if model == "thermal" else 0.0).astype("<f4"))
            code, lines, _ = self.run_study(folder)
            self.assertEqual(code, 0)
            found = {(line["model"], line["kind"], line["index"]): line for line in lines}
            self.assertEqual(len(found), 12)
            self.assertLess(found["thermal", "predicted", 1]["rms_px"], 0.1)
            self.assertEqual(found["thermal", "predicted", 1]["lost_frac"], 0.0)
            self.assertAlmostEqual(found["thermal", "stored", 1]["median_px"], 4.0, delta=0.1)
            self.assertAlmostEqual(found["plain", "predicted", 1]["median_px"], 4.0, delta=0.1)
            self.assertGreater(found["none", "predicted", 1]["lost_frac"], 0.9)
            self.assertLess(found["none", "stored", 0]["rms_px"], 0.1)

    def test_it_says_why_there_is_no_study(self):
        with tempfile.TemporaryDirectory() as name:
            code, _, err = self.run_study(name)
            self.assertEqual(code, 1)
            self.assertIn("truth_00.npy", err)
            np.save(pathlib.Path(name) / "truth_00.npy", np.full((120, 140), 5.0, "<f4"))
            code, _, err = self.run_study(name)
            self.assertEqual(code, 1)
            self.assertIn("no window", err)
