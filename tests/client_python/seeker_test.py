# SPDX-License-Identifier: Apache-2.0
import math
import unittest

import numpy as np
from emit_client import ArgumentError
from emit_client.correlation import Template
from emit_client.frame_header import FrameHeader
from emit_client.hot_spot import Gate, find_hot_spot
from emit_client.seeker import CorrelationTracker, HotSpotTracker, angles_of, answer_of

ERF = np.vectorize(math.erf)


def gaussian_spot(x_px, y_px, sigma_px, shape=(64, 80), level=10.0, peak=5.0):
    """Returns an image of a Gaussian spot, integrated over the area of every pixel."""
    def integral(count, centre):
        edges = ERF((np.arange(count + 1) - centre) / (math.sqrt(2) * sigma_px))
        return np.diff(edges) / 2 * math.sqrt(2 * math.pi) * sigma_px
    return level + peak * np.outer(integral(shape[0], y_px), integral(shape[1], x_px))


def waves(x_px, y_px, shape=(72, 72)):
    """Returns an image of 40 plane waves of wavelengths above 8 px, shifted by exactly this many pixels."""
    generator = np.random.default_rng(7)
    y, x = np.indices(shape) + 0.5
    out = np.zeros(shape)
    for _ in range(40):
        frequency = 2 * math.pi / generator.uniform(8, 40)
        angle, phase = generator.uniform(0, 2 * math.pi, 2)
        out += np.cos(frequency * ((x - x_px) * math.cos(angle) + (y - y_px) * math.sin(angle)) + phase)
    return 300.0 + out


class HotSpot(unittest.TestCase):
    def test_the_centre_of_gaussian_spots_is_found_within_a_thirtieth_of_a_pixel(self):
        generator = np.random.default_rng(1)
        worst = 0.0
        for sigma_px in (1.0, 1.5, 2.5, 4.0):
            for _ in range(50):
                x_px, y_px = generator.uniform(36, 44), generator.uniform(28, 36)
                spot = find_hot_spot(gaussian_spot(x_px, y_px, sigma_px), Gate(40, 32, 20))
                worst = max(worst, math.hypot(spot.x_px - x_px, spot.y_px - y_px))
        self.assertLess(worst, 1 / 30)

    def test_the_noise_of_the_centroid_falls_with_the_signal(self):
        generator = np.random.default_rng(2)
        def error(noise):
            sums = 0.0
            for _ in range(100):
                image = gaussian_spot(40.3, 31.8, 1.5) + generator.normal(0, noise, (64, 80))
                spot = find_hot_spot(image, Gate(40, 32, 16))
                sums += (spot.x_px - 40.3) ** 2 + (spot.y_px - 31.8) ** 2
            return math.sqrt(sums / 100)
        self.assertLess(error(0.05), 0.05)
        self.assertLess(error(0.2), 0.2)

    def test_a_brighter_spot_outside_the_gate_does_not_count(self):
        image = gaussian_spot(20, 20, 1.5) + gaussian_spot(60, 40, 1.5, peak=20.0)
        spot = find_hot_spot(image, Gate(20, 20, 12))
        self.assertAlmostEqual(spot.x_px, 20.0, delta=0.05)
        self.assertAlmostEqual(spot.y_px, 20.0, delta=0.05)

    def test_a_weaker_spot_apart_does_not_move_the_centroid(self):
        image = gaussian_spot(30, 30, 1.5) + gaussian_spot(42, 30, 1.5, peak=4.0, level=0.0)
        self.assertAlmostEqual(find_hot_spot(image, Gate(36, 30, 16)).x_px, 30.0, delta=0.05)

    def test_noise_alone_even_images_and_gates_outside_have_no_spot(self):
        noise = np.random.default_rng(3).normal(10, 0.1, (64, 80))
        self.assertIsNone(find_hot_spot(noise, Gate(40, 32, 12)))
        self.assertIsNone(find_hot_spot(np.full((64, 80), 5.0), Gate(40, 32, 12)))
        self.assertIsNone(find_hot_spot(noise, Gate(400, 32, 12)))
        self.assertIsNone(find_hot_spot(np.full((64, 80), math.nan), Gate(40, 32, 12)))

    def test_the_gate_follows_a_moving_spot_and_finds_it_again_after_a_gap(self):
        tracker = HotSpotTracker()
        for step in range(20):
            x_px = 75 + 1.5 * step
            found = tracker.track(gaussian_spot(x_px, 32, 1.5, shape=(64, 160)))
            self.assertAlmostEqual(found[0], x_px, delta=0.05)
        self.assertIsNone(tracker.track(np.full((64, 160), 10.0)))
        # The gate grows while nothing is found: the spot comes back 30 px away.
        self.assertIsNone(tracker.track(gaussian_spot(133, 32, 1.5, shape=(64, 160))))
        for _ in range(20):
            tracker.track(np.full((64, 160), 10.0))
        self.assertAlmostEqual(tracker.track(gaussian_spot(80, 32, 1.5, shape=(64, 160)))[0], 80, delta=0.05)


class Correlation(unittest.TestCase):
    def test_shifts_of_a_texture_are_found_within_a_twentieth_of_a_pixel(self):
        template = Template(waves(0, 0)[20:52, 20:52])
        generator = np.random.default_rng(4)
        worst = 0.0
        for _ in range(40):
            x_px, y_px = generator.uniform(-8, 8, 2)
            match = template.find(waves(x_px, y_px))
            worst = max(worst, math.hypot(match.x_px - 36 - x_px, match.y_px - 36 - y_px))
            self.assertFalse(match.at_edge)
        self.assertLess(worst, 1 / 20)

    def test_gain_and_offset_of_the_image_change_nothing(self):
        template = Template(waves(0, 0)[20:52, 20:52])
        image = waves(2.3, -1.6)
        one, other = template.find(image), template.find(0.02 * image - 7)
        self.assertAlmostEqual(one.x_px, other.x_px, places=9)
        self.assertAlmostEqual(one.y_px, other.y_px, places=9)
        self.assertAlmostEqual(one.correlation, other.correlation, places=9)

    def test_correlations_are_those_of_the_definition(self):
        generator = np.random.default_rng(5)
        image, pixels = generator.normal(300, 1, (9, 12)), generator.normal(300, 1, (4, 5))
        values = Template(pixels).correlations(image)
        self.assertEqual(values.shape, (6, 8))
        for row in range(6):
            for column in range(8):
                window = image[row:row + 4, column:column + 5]
                self.assertAlmostEqual(values[row, column], np.corrcoef(window.ravel(), pixels.ravel())[0, 1], places=9)

    def test_a_negative_is_no_match_and_a_flat_window_has_no_correlation(self):
        pixels = waves(0, 0)[20:40, 20:40]
        self.assertLess(Template(pixels).correlations(-pixels)[0, 0], -0.999)
        self.assertEqual(Template(pixels).correlations(np.full((20, 20), 300.0))[0, 0], 0.0)

    def test_a_peak_at_the_edge_is_told(self):
        image = waves(0, 0)
        self.assertTrue(Template(image[0:32, 20:52]).find(image).at_edge)

    def test_templates_that_cannot_match_are_refused(self):
        self.assertRaisesRegex(ArgumentError, "no contrast", Template, np.full((5, 5), 300.0))
        self.assertRaisesRegex(ArgumentError, "3 x 3", Template, np.zeros((2, 5)))
        self.assertRaisesRegex(ArgumentError, "not finite", Template, np.full((5, 5), math.nan))
        self.assertRaisesRegex(ArgumentError, "smaller than", Template(waves(0, 0)).find, np.zeros((5, 5)))

    def test_the_tracker_keeps_the_aim_point_through_new_templates(self):
        tracker = CorrelationTracker(size_px=24)
        at = (36.0, 36.0)
        for step in range(12):
            # The texture grows as the seeker comes closer, so that templates wear out.
            at = (36.0 + 0.7 * step, 36.0 - 0.4 * step)
            found = tracker.track(waves(0.7 * step, -0.4 * step))
        self.assertLess(math.hypot(found[0] - at[0], found[1] - at[1]), 0.3)
        self.assertIsNone(tracker.track(np.random.default_rng(6).normal(300, 1, (72, 72))))


class Answers(unittest.TestCase):
    def test_angles_are_right_and_up_of_the_axis(self):
        self.assertEqual(angles_of(160, 128, 320, 256, 1000), (0.0, 0.0))
        azimuth, elevation = angles_of(260, 28, 320, 256, 1000)
        self.assertAlmostEqual(azimuth, math.atan(0.1))
        # The direction is (1000 forward, 100 right, 100 up).
        self.assertAlmostEqual(math.sin(elevation), 100 / math.sqrt(1000**2 + 100**2 + 100**2))
        self.assertAlmostEqual(math.cos(elevation) * math.sin(azimuth), 100 / math.sqrt(1000**2 + 100**2 + 100**2))

    def test_an_answer_counts_pixels_of_the_sensor_not_of_the_window(self):
        names = FrameHeader.__dataclass_fields__
        fields = {name: 0 for name in names} | {
            "host_frame_number": 7, "width_px": 64, "height_px": 64, "window_x_px": 128, "window_y_px": 96,
            "sensor_width_px": 320, "sensor_height_px": 256}
        answer = answer_of(FrameHeader(**fields), (32.0, 32.0, 50.0), 1000.0, 5)
        self.assertEqual((answer["x_px"], answer["y_px"], answer["azimuth_rad"]), (160.0, 128.0, 0.0))
        self.assertEqual((answer["host_frame_number"], answer["found"], answer["received_ns"]), (7, True, 5))
        lost = answer_of(FrameHeader(**fields), None, 1000.0, 5)
        self.assertFalse(lost["found"])
        self.assertNotIn("x_px", lost)
