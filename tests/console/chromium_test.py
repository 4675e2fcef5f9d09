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

import math  # noqa: E402
import struct  # noqa: E402
import time  # noqa: E402
import unittest  # noqa: E402

import numpy as np  # noqa: E402
from console_daemon import (  # noqa: E402
    HEIGHT_PX, IG_CLOCK, STEP_NS, WIDTH_PX, CigiRig, address_of, start, swinging_axes)
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

    def brightness(self):
        """Returns how bright pixels of a row are drawn, from the one with the smallest value to the largest."""
        return self.page.evaluate(
            "(() => { const image = emitConsole.image; const gl = image.gl; image.draw(); const seen = [];"
            f"for (let x = 0; x < {WIDTH_PX}; x += 8) {{ const data = new Uint8Array(4);"
            f"gl.readPixels(x, {HEIGHT_PX - 1 - 60}, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, data);"
            "seen.push([image.value({ x, y: 60 }), data[0]]); }"
            "return seen.sort((a, b) => a[0] - b[0]).map((one) => one[1]); })()")

    def test_follows_sensor_control_of_a_cigi_host_until_a_limit_is_set_by_hand(self):
        with CigiRig() as rig:
            self.open(rig.daemon)
            self.page.wait_for("document.querySelector('#state').textContent === 'running'", PATIENCE_S)
            end_s = time.monotonic() + PATIENCE_S
            while not self.page.evaluate(f"{SHOWN} > 0 && emitConsole.showsKelvins"):
                self.assertLess(time.monotonic(), end_s, "no image came")
                # The page may be slow to ask for an image, and one comes only with a further frame.
                for _ in range(5):
                    rig.step()
            limits = "[emitConsole.low, emitConsole.high]"
            button = "document.querySelector('#auto').textContent"
            self.assertEqual(self.page.evaluate(button), "Auto")
            self.page.press("m")  # grey shows polarity plainly
            found = self.page.evaluate(limits)
            rig.step(gain=0.5, level=0.5)
            self.page.wait_for(f"{button} === 'Host' && String({limits}) === '280,330'", PATIENCE_S)
            white = self.brightness()
            self.assertEqual(white, sorted(white))
            self.assertGreater(white[-1], white[0])
            rig.step(gain=0.5, level=0.5, black_hot=True)
            self.page.wait_for("emitConsole.wish.black_hot", PATIENCE_S)
            self.assertEqual(self.page.evaluate(limits), [280, 330])
            black = self.brightness()
            self.assertEqual(black, sorted(black, reverse=True))
            self.assertGreater(black[0], black[-1])
            # Off is black, and a limit by hand shows what emitd sends all the same.
            rig.step(on=False)
            self.page.wait_for("emitConsole.image.blank", PATIENCE_S)
            self.page.wait_for("document.querySelector('#stale').textContent.includes('switched the sensor off')"
                               " && !document.querySelector('#stale').hidden", PATIENCE_S)
            self.assertEqual(set(self.brightness()), {0})
            self.page.press("=")
            self.page.wait_for("!emitConsole.image.blank && emitConsole.wish === null", PATIENCE_S)
            by_hand = self.page.evaluate(limits)
            rig.step(gain=0.9, level=0.1)
            self.page.wait_for("emitConsole.picture.on", PATIENCE_S)
            self.assertEqual(self.page.evaluate(limits), by_hand)
            self.page.press("r")
            width_k = 50 * 10**-0.8
            self.page.wait_for(f"Math.abs(emitConsole.high - emitConsole.low - {width_k}) < 1e-3", PATIENCE_S)
            # Automatic gain is the page's own.
            rig.step(automatic=True)
            self.page.wait_for("emitConsole.picture.automatic_gain", PATIENCE_S)
            again = self.page.evaluate(limits)
            for want, got in zip(found, again):
                self.assertAlmostEqual(want, got, delta=0.2 * (found[1] - found[0]))
            self.assert_stays_on_this_machine(rig.daemon)

    def test_fits_into_windows_of_any_width_from_1024_on(self):
        with start(IG_CLOCK) as daemon:
            self.open(daemon)
            self.page.wait_for(f"{SHOWN} > 0", PATIENCE_S)
            # A device with a long name stands in the header, as those of software renderers do.
            self.page.evaluate("document.querySelector('#about').textContent = 'emitd 0.2.0 '.repeat(40)")
            for width_px in (1024, 1200, 1400, 1545, 1920):
                self.page.resize(width_px, 900)
                right_px = self.page.evaluate(
                    "Math.max(...[...document.querySelectorAll('nav button, main, aside')]"
                    ".map((each) => each.getBoundingClientRect().right))")
                self.assertLessEqual(right_px, width_px)

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

    def test_shows_the_axes_of_the_motion_simulator_over_time(self):
        # One ring carries all of the swing. The table follows it by a known time late, so that the error is known too.
        amplitude_rad, rate_rad_s, delay_s = 0.1, 2.0, 0.04
        with swinging_axes(300, amplitude_rad, rate_rad_s, delay_s) as daemon:
            self.open(daemon)
            axis = "emitConsole.axes.axes[{}]"
            span = ("(() => { let low = Infinity, high = -Infinity; {0}.{1}.each(-Infinity, (_, v) => {"
                    "if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); } });"
                    "return high - low; })()")

            def span_of(i, what):
                return self.page.evaluate(span.replace("{0}", axis.format(i)).replace("{1}", what))

            self.page.wait_for("document.querySelector('#axes-state').textContent.startsWith('following')", PATIENCE_S)
            self.page.evaluate("emitConsole.axes.axes.forEach((one) => {"
                               "one.demand.clear(); one.measured.clear(); one.error.clear(); })")
            # Two periods of the swing.
            self.page.wait_for("emitConsole.axes.axes[0].error.count > 310", PATIENCE_S)
            full_deg = 2 * math.degrees(amplitude_rad)
            demanded = [span_of(i, "demand") for i in range(3)]
            swinging = max(range(3), key=lambda i: demanded[i])
            self.assertAlmostEqual(demanded[swinging], full_deg, delta=0.03 * full_deg)
            self.assertAlmostEqual(span_of(swinging, "measured"), full_deg, delta=0.03 * full_deg)
            for other in set(range(3)) - {swinging}:
                self.assertLess(demanded[other], 0.01 * full_deg)
            # sin(a - b) - sin(a) has the amplitude 2 sin(b / 2).
            error_mdeg = 1000 * full_deg * 2 * math.sin(0.5 * rate_rad_s * delay_s)
            self.assertAlmostEqual(span_of(swinging, "error"), error_mdeg, delta=0.1 * error_mdeg)
            # Strips are drawn, and the keyboard and a click choose the axis.
            self.page.press("a")
            self.page.evaluate(f"document.querySelector('#axes').tBodies[0].rows[{swinging}].cells[0].click()")
            self.assertEqual(self.page.evaluate("emitConsole.axes.chosen"), swinging)
            for canvas in ("#axes-strip", "#axes-error-strip"):
                colors = self.page.evaluate(
                    f"(() => {{ const c = document.querySelector('{canvas}'); const d = c.getContext('2d')"
                    ".getImageData(0, 0, c.width, c.height).data; const seen = new Set();"
                    "for (let i = 0; i < d.length; i += 4) seen.add(d[i] << 16 | d[i + 1] << 8 | d[i + 2]);"
                    "return seen.size; })()")
                self.assertGreater(colors, 8, canvas)
            self.page.keep("axes")
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
