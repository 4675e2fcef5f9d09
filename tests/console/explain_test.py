# SPDX-License-Identifier: Apache-2.0
"""The history of a probed surface in headless Chromium: its numbers are those of `emit explain` for the same pixel and
instant, and the frames beside it go on without a gap. Exits 77 where it cannot run on this machine."""
import sys

import skip

skip.skip_without("websockets", "numpy", "google.protobuf")

import browser  # noqa: E402: the modules that the test needs are there only now

if browser.program() is None:
    skip.skip("Chromium is not installed; Debian's package is chromium")

import json  # noqa: E402
import subprocess  # noqa: E402
import unittest  # noqa: E402

from console_daemon import BIN_DIR, SceneDaemon, address_of, start  # noqa: E402
from emit_client import FrameClient  # noqa: E402

SCENARIO = "block-on-road"
WIDTH_PX, HEIGHT_PX = 80, 64
TIME_S = 12600
SETTINGS = (f"sensor.width_px={WIDTH_PX}", f"sensor.height_px={HEIGHT_PX}")
PATIENCE_S = 400.0


def place_of(page, x, y):
    left, top, width, height = page.evaluate(
        "(() => { const box = document.querySelector('#overlay').getBoundingClientRect();"
        "return [box.left, box.top, box.width, box.height]; })()")
    return left + (x + 0.5) * width / WIDTH_PX, top + (y + 0.5) * height / HEIGHT_PX


class Explain(unittest.TestCase):
    def setUp(self):
        self.page = browser.Browser(1280, 800)
        self.addCleanup(self.page.close)

    def test_has_the_numbers_of_emit_explain_and_costs_no_frame(self):
        x, y = 75, 35
        with SceneDaemon(SCENARIO, 'mode = "ig-clock"\nrate_hz = 2.0', SETTINGS, f"first_time_s = {TIME_S}.0") as daemon, \
                FrameClient.connect(daemon.tcp_url) as client:
            self.page.open(f"http://{address_of(daemon)}/")
            self.page.wait_for("emitConsole.image.frame !== null", PATIENCE_S)
            client.subscribe()
            numbers = [frame.header.frame_number for frame in client.frames(4)]
            self.page.click(*place_of(self.page, x, y))
            self.page.wait_for("!document.querySelector('#explain').hidden", PATIENCE_S)
            while self.page.evaluate("emitConsole.explain.found[0]") is None:
                numbers.append(client.receive().header.frame_number)
            self.assertEqual(numbers, list(range(numbers[0], numbers[0] + len(numbers))), "a frame is missing")
            found = self.page.evaluate("emitConsole.explain.found[0]")
            self.assertIsNone(found["error"])
            sim_time_s = found["result"]["sim_time_s"]
            shown = self.page.evaluate(
                "(() => { const canvas = document.querySelector('#explain-plot'); const d = canvas.getContext('2d')"
                ".getImageData(0, 0, canvas.width, canvas.height).data; const seen = new Set();"
                "for (let i = 0; i < d.length; i += 4) seen.add(d[i] << 16 | d[i + 1] << 8 | d[i + 2]);"
                "return [seen.size, document.querySelector('#explain-state').textContent,"
                "document.querySelector('#explain-terms').tBodies[0].rows.length]; })()")
            self.assertGreater(shown[0], 20)
            self.assertIn("block_on_road", shown[1])
            self.assertGreaterEqual(shown[2], 4)
            self.page.keep("explain", ((1024, 768), (1920, 1080)))
            # By the keyboard: it closes, opens again without a further question, and goes with its probe.
            self.page.press("Escape")
            self.page.wait_for("document.querySelector('#explain').hidden", PATIENCE_S)
            self.page.press("e")
            self.page.wait_for("!document.querySelector('#explain').hidden", PATIENCE_S)
            self.assertEqual(self.page.evaluate("emitConsole.explain.found[0].frame"), found["frame"])
            self.page.press("Delete")
            self.page.wait_for("document.querySelector('#explain').hidden", PATIENCE_S)
            self.assertIsNone(self.page.evaluate("emitConsole.probes.places[0]"))
            own = (f"http://{address_of(daemon)}/", f"ws://{address_of(daemon)}/", "about:", "data:")
            self.assertEqual([url for url in self.page.requests if not url.startswith(own)], [])
            self.assertEqual(self.page.errors, [])
            overrides = daemon.overrides
        # The command knows no run: the sensor and the scene are where the scenario puts them.
        answer = subprocess.run(
            [BIN_DIR / "emit", "explain", SCENARIO, *overrides, "--time-s", repr(sim_time_s), "--px", f"{x},{y}",
             "--background", "--json", "-"], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(answer.returncode, 0, answer.stderr)
        alone = json.loads(answer.stdout)
        self.assertEqual(found["result"]["history"], alone["history"])
        self.assertEqual(found["result"]["bands"], alone["bands"])
        self.assertEqual(found["result"]["surface"], alone["surface"])
        self.assertTrue(any(row["equilibrium_k"] is not None for row in alone["history"]))

    def test_says_why_nothing_is_explained(self):
        with start('mode = "ig-clock"\nrate_hz = 20.0') as daemon:
            self.page.open(f"http://{address_of(daemon)}/")
            self.page.wait_for("emitConsole.image.frame !== null", PATIENCE_S)
            self.page.evaluate("document.querySelector('#overlay').focus()")
            self.page.press("ArrowLeft")
            self.page.press("Enter")
            self.assertTrue(self.page.evaluate("document.querySelector('#explain').hidden"), "a probe is put as ever")
            self.page.press("e")
            self.page.wait_for("document.querySelector('#explain-state').textContent.includes('rendered scenes')", PATIENCE_S)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
