# SPDX-License-Identifier: Apache-2.0
"""A replay with a console in headless Chromium: the bar seeks, holds, steps, loops and paces, and the frames behind a
seek are those of a straight replay, bit for bit. Exits 77 where it cannot run on this machine."""
import sys

import skip

skip.skip_without("websockets", "numpy", "google.protobuf")

import browser  # noqa: E402: the modules that the test needs are there only now

if browser.program() is None:
    skip.skip("Chromium is not installed; Debian's package is chromium")

import json  # noqa: E402
import math  # noqa: E402
import subprocess  # noqa: E402
import unittest  # noqa: E402

from console_daemon import BIN_DIR, SceneDaemon, replay_console  # noqa: E402
from emit_client import FrameClient, HostClient, Pose  # noqa: E402

SCENARIO = "box"
SIZE = ("sensor.width_px=96", "sensor.height_px=64")
FRAMES = 24
STEP_NS = 40_000_000
PATIENCE_S = 120.0
SHOWN = "Number(document.querySelector('#frame-number').textContent)"
STATE = "emitConsole.replay.state"


class Replay(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # A camera that flies past the box, so that no frame is like another one.
        cls.daemon = SceneDaemon(SCENARIO, 'mode = "host-step"', SIZE)
        cls.addClassCleanup(cls.daemon.close)
        cls.crcs, cls.times_s = {}, {}
        with FrameClient.connect(cls.daemon.tcp_url) as client, HostClient.connect(cls.daemon.tcp_url) as host:
            client.subscribe()
            for i in range(FRAMES):
                host.send_pose((i + 1) * STEP_NS, Pose.heading((-12.0 + 0.2 * i, -9.0, 3.0), math.radians(40.0)))
                header = client.receive().header
                cls.crcs[header.frame_number] = header.payload_crc32c
                cls.times_s[header.frame_number] = header.sim_time_ns / 1e9
        cls.daemon.stop()

    def setUp(self):
        self.page = browser.Browser(1280, 800)
        self.addCleanup(self.page.close)

    def open(self, address):
        self.page.open(f"http://{address}/")
        self.page.wait_for(f"{SHOWN} > 0 && {STATE} !== null", PATIENCE_S)

    def hold(self):
        self.page.press("h")
        # The image comes by itself, and may be one frame behind the state.
        self.page.wait_for(f"!{STATE}.playing && {STATE}.target_s === null && {SHOWN} === {STATE}.frame + 1", PATIENCE_S)

    def wait_for_frame(self, number):
        try:
            self.page.wait_for(f"{SHOWN} === {number} && {STATE}.target_s === null && {STATE}.frame === {number - 1} && "
                               f"emitConsole.image.frame.frame_number === {number}", PATIENCE_S)
        except TimeoutError as error:
            found = self.page.evaluate(f"JSON.stringify([{SHOWN}, {STATE}, emitConsole.image.frame.frame_number])")
            raise TimeoutError(f"{error}; found {found}") from error

    def assert_is_recorded(self):
        """The image on the page is that of the recording: its checksum, and the simulation time where the bar stands."""
        number, crc, sim_time_s, at_s, shown_s = self.page.evaluate(
            "(() => { const f = emitConsole.image.frame; const s = emitConsole.replay.state;"
            "return [f.frame_number, f.crc32c, f.sim_time_s, s.sim_time_s, s.frame]; })()")
        self.assertEqual(crc, self.crcs[number], f"frame {number}")
        self.assertAlmostEqual(sim_time_s, self.times_s[number], places=9)
        self.assertAlmostEqual(at_s, sim_time_s, places=9)
        self.assertEqual(shown_s, number - 1)
        return number

    def place_of(self, frame):
        """Returns the place of a frame on the bar, in the window, once the page has stopped to move it."""
        place, before = self.place_now(frame), None
        while place != before:
            self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
            place, before = self.place_now(frame), place
        return place

    def place_now(self, frame):
        return self.page.evaluate(
            f"(() => {{ const bar = emitConsole.replay; const box = document.querySelector('#replay-bar')"
            f".getBoundingClientRect(); return [box.left + bar.placeOf(bar.recording.times[{frame}][0]) - 0.4,"
            f"box.top + 26]; }})()")

    def test_the_bar_seeks_and_its_frames_are_those_of_a_straight_replay(self):
        with replay_console(self.daemon.journal, SCENARIO, self.daemon.overrides, "--speed", "max") as address:
            self.open(address)
            self.wait_for_frame(FRAMES)  # played to the end
            self.assertFalse(self.page.evaluate(f"{STATE}.playing"))
            for frame in (6, 17, 2):  # a click: back, on, and back
                self.page.click(*self.place_of(frame))
                self.page.wait_for(f"{SHOWN} < {FRAMES} && {STATE}.target_s === null", PATIENCE_S)
                near = f"Math.abs({SHOWN} - {frame + 1}) <= 1"
                self.page.wait_for(f"{near} && emitConsole.image.frame.frame_number === {SHOWN} && "
                                   f"{STATE}.frame === {SHOWN} - 1", PATIENCE_S)
                self.assert_is_recorded()
            # Keys: the bar has the focus.
            self.page.evaluate("document.querySelector('#replay-bar').focus()")
            self.page.press("End")
            self.wait_for_frame(FRAMES)
            self.assert_is_recorded()
            self.page.press("ArrowLeft")
            self.wait_for_frame(FRAMES - 1)
            self.assert_is_recorded()
            self.page.press("Home")
            self.wait_for_frame(1)
            self.page.press("ArrowRight")
            self.wait_for_frame(2)
            self.assert_is_recorded()
            # Drag: nothing happens before the pointer is let go.
            x, y = self.place_of(10)

            def mouse(kind, at, **more):
                self.page.call("Input.dispatchMouseEvent", type=kind, x=at, y=y, button="left", **more)

            mouse("mousePressed", self.place_of(17)[0], buttons=1, clickCount=1)
            mouse("mouseMoved", x, buttons=1)
            self.assertEqual(self.page.evaluate(SHOWN), 2)
            mouse("mouseReleased", x, clickCount=1)
            self.page.wait_for(f"{SHOWN} >= 10 && {SHOWN} <= 12 && {STATE}.frame === {SHOWN} - 1", PATIENCE_S)
            self.assert_is_recorded()
            self.page.keep("replay", ((1024, 768), (1920, 1080)))
            self.assertEqual(self.page.errors, [])
            own = (f"http://{address}/", f"ws://{address}/", "about:", "data:")
            self.assertEqual([url for url in self.page.requests if not url.startswith(own)], [])

    def test_a_step_a_rate_and_a_loop(self):
        with replay_console(self.daemon.journal, SCENARIO, self.daemon.overrides, "--speed", "0.0001") as address:
            self.open(address)
            # A toast goes after some seconds, and a busy machine may look too late.
            self.page.evaluate("(() => { window.toasts = ''; new MutationObserver(() => window.toasts += "
                               "document.querySelector('#toast').textContent).observe(document.querySelector('#toast'), "
                               "{childList: true, characterData: true, subtree: true}); })()")
            self.page.press("n")
            self.page.wait_for("window.toasts.includes('hold or stop')", PATIENCE_S)
            self.hold()
            before = self.page.evaluate(SHOWN)
            self.page.press("n")
            self.wait_for_frame(before + 1)
            self.assert_is_recorded()
            self.page.press("b")
            self.wait_for_frame(before)
            self.assert_is_recorded()
            self.page.evaluate("emitConsole.replay.seek(emitConsole.replay.recording.times[4][0])")
            self.wait_for_frame(5)
            self.page.press("o")
            self.page.evaluate("emitConsole.replay.seek(emitConsole.replay.recording.times[7][0])")
            self.wait_for_frame(8)
            self.page.press("o")
            self.page.wait_for(f"{STATE}.loop_s !== null", PATIENCE_S)
            self.page.evaluate("(() => { const rate = document.querySelector('#replay-rate'); rate.value = 'max';"
                               "rate.onchange(); })()")
            self.page.wait_for(f"{STATE}.rate === 0", PATIENCE_S)
            # A page hears where the replay stands several times a second, so that the loop lasts two seconds here.
            span_s = self.page.evaluate(f"{STATE}.loop_s[1] - {STATE}.loop_s[0]")
            self.page.evaluate(f"emitConsole.replay.send('rate {span_s / 2.0:.9f}')")
            self.page.wait_for(f"{STATE}.rate > 0", PATIENCE_S)
            self.page.press("s")
            # It goes from frame 8 back to frame 5, and not beyond frame 8.
            self.page.evaluate("(() => { window.seen = new Set(); window.watch = setInterval(() => "
                               "window.seen.add(emitConsole.replay.state.frame + 1), 20); })()")
            self.page.wait_for("window.seen.size >= 3 && window.seen.has(5)", PATIENCE_S)
            self.assertLessEqual(set(self.page.evaluate("[...window.seen]")), {5, 6, 7, 8})
            self.assertEqual(self.page.errors, [])

    def test_the_command_compares_every_frame_as_without_a_console(self):
        answer = subprocess.run(
            [BIN_DIR / "emit", "replay", self.daemon.journal, "--scenario", SCENARIO, *self.daemon.overrides, "--json", "-"],
            capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(answer.returncode, 0, answer.stderr)
        self.assertTrue(json.loads(answer.stdout)["bit_identical"])
        refused = subprocess.run(
            [BIN_DIR / "emit", "replay", self.daemon.journal, "--scenario", SCENARIO, *self.daemon.overrides, "--console",
             "0.0.0.0:0"], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("other hosts may reach it", refused.stderr)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
