# SPDX-License-Identifier: Apache-2.0
"""The operator's console in headless Chromium: it draws, its probes have the floats that clients get, it outlives a
restart of emitd, it asks no other host, and a page that does not draw costs a stream no frame. Exits 77 where it cannot
run on this machine."""
import sys

import skip

skip.skip_without("websockets", "numpy", "google.protobuf")

import browser  # noqa: E402: the modules that the test needs are there only now

if browser.program() is None:
    skip.skip("Chromium is not installed; Debian's package is chromium")

import struct  # noqa: E402
import time  # noqa: E402
import unittest  # noqa: E402

import numpy as np  # noqa: E402
from console_daemon import HEIGHT_PX, IG_CLOCK, STEP_NS, WIDTH_PX, address_of, start  # noqa: E402
from emit_client import FrameClient, HostClient, Pose  # noqa: E402

PATIENCE_S = 120.0
SHOWN = "Number(document.querySelector('#frame-number').textContent)"


def place_of(page, x, y):
    """Returns where a pixel of the image lies in the window."""
    left, top, width, height = page.evaluate(
        "(() => { const box = document.querySelector('#overlay').getBoundingClientRect();"
        "return [box.left, box.top, box.width, box.height]; })()")
    return left + (x + 0.5) * width / WIDTH_PX, top + (y + 0.5) * height / HEIGHT_PX


class Console(unittest.TestCase):
    def setUp(self):
        self.page = browser.Browser(1280, 800)
        self.addCleanup(self.page.close)

    def open(self, daemon):
        self.page.open(f"http://{address_of(daemon)}/")

    def assert_stays_on_this_machine(self, daemon):
        own = (f"http://{address_of(daemon)}/", f"ws://{address_of(daemon)}/", "about:", "data:")
        foreign = [url for url in self.page.requests if not url.startswith(own)]
        self.assertEqual(foreign, [])
        self.assertEqual(self.page.errors, [])

    def test_draws_and_its_probe_has_the_float_that_a_client_gets(self):
        with start('mode = "host-step"') as daemon, FrameClient.connect(daemon.tcp_url) as client:
            client.subscribe()
            self.open(daemon)
            self.page.wait_for("document.querySelector('#state').textContent === 'running'", PATIENCE_S)
            images = {}
            with HostClient.connect(daemon.tcp_url) as host:
                def step():
                    number = host.send_pose((len(images) + 1) * STEP_NS, Pose.heading((0.0, 0.0, 100.0), heading_rad=0.0))
                    images[number] = client.receive().copy().pixels

                end_s = time.monotonic() + PATIENCE_S
                while not self.page.evaluate(f"{SHOWN} > 0"):
                    self.assertLess(time.monotonic(), end_s, "no image came")
                    step()
                x, y = 37, 81
                self.page.click(*place_of(self.page, x, y))
                self.page.wait_for("document.querySelectorAll('#probes button:not([hidden])').length === 1", PATIENCE_S)
                before = self.page.evaluate(SHOWN)
                while self.page.evaluate(SHOWN) == before:
                    self.assertLess(time.monotonic(), end_s, "no further image came")
                    step()
                    time.sleep(0.02)
                number, value, reading = self.page.evaluate(
                    f"[{SHOWN}, emitConsole.probes.radiance[0].last, document.querySelector('#cursor').textContent]")
            want = np.asarray(images[number], np.float32).reshape(HEIGHT_PX, WIDTH_PX)[y, x]
            self.assertEqual(struct.pack("<f", value), struct.pack("<f", want))
            self.assertEqual(value, float(want))
            self.assertTrue(reading.startswith(f"x {x}  y {y}"), reading)
            # The picture is not of one colour, and not that of an empty page. Read it from WebGL itself in the turn in
            # which it is drawn, because a canvas need not keep it for longer.
            colors = self.page.evaluate(
                "(() => { const image = emitConsole.image; const gl = image.gl; image.draw();"
                "const data = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);"
                "gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, data);"
                "const seen = new Set(); for (let i = 0; i < data.length; i += 4)"
                "seen.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]); return seen.size; })()")
            self.assertGreater(colors, 30)
            self.assert_stays_on_this_machine(daemon)

    def test_a_command_changes_the_run(self):
        with start(IG_CLOCK) as daemon:
            self.open(daemon)
            self.page.wait_for(f"{SHOWN} > 0", PATIENCE_S)  # the run goes on
            self.page.press("h")
            self.page.wait_for("document.querySelector('#state').textContent === 'held'", PATIENCE_S)
            self.page.press("x")
            self.page.wait_for("document.querySelector('#state').textContent === 'stopped'", PATIENCE_S)
            self.page.evaluate("document.querySelector('#start').click()")
            self.page.wait_for("document.querySelector('#state').textContent === 'running'", PATIENCE_S)
            self.assert_stays_on_this_machine(daemon)

    def test_outlives_a_restart_of_the_daemon(self):
        with start(IG_CLOCK) as daemon:
            address = address_of(daemon)
            self.open(daemon)
            self.page.wait_for(f"{SHOWN} > 20", PATIENCE_S)
            self.page.click(*place_of(self.page, 5, 5))
            daemon.stop()
            self.page.wait_for("document.body.classList.contains('lost')", PATIENCE_S)
        with start(IG_CLOCK, address) as daemon:
            self.page.wait_for("!document.body.classList.contains('lost')", PATIENCE_S)
            self.page.wait_for(f"emitConsole.image.frame.run_id === emitConsole.runId && {SHOWN} > 20", PATIENCE_S)
            self.assertEqual(self.page.evaluate("emitConsole.probes.places[0].x"), 5)
            self.assert_stays_on_this_machine(daemon)

    def test_a_page_that_does_not_draw_costs_a_stream_no_frame(self):
        with start(IG_CLOCK) as daemon, FrameClient.connect(daemon.tcp_url) as client:
            self.open(daemon)
            self.page.wait_for(f"{SHOWN} > 0", PATIENCE_S)
            client.subscribe()
            # The page's thread is busy for three seconds and takes no message.
            self.page.evaluate(
                "setTimeout(() => { const end = performance.now() + 3000; while (performance.now() < end); }, 0)")
            numbers = [frame.header.frame_number for frame in client.frames(100)]
            self.assertEqual(numbers, list(range(numbers[0], numbers[0] + 100)))
            self.page.wait_for(f"{SHOWN} > {numbers[-1]}", PATIENCE_S)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
