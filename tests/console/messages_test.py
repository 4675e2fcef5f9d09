# SPDX-License-Identifier: Apache-2.0
"""HTTP and WebSocket of the operator's console, without a browser: who is let in, what a page is told, what becomes of
its commands. Exits 77 where a module of Python is absent."""
import sys

from skip import skip_without

skip_without("websockets", "numpy", "google.protobuf")

import asyncio  # noqa: E402: the modules that the test needs are there only now
import http.client  # noqa: E402
import json  # noqa: E402
import struct  # noqa: E402
import time  # noqa: E402
import unittest  # noqa: E402

import websockets  # noqa: E402
from cigi_host import CigiHost, CigiHost4  # noqa: E402
from console_daemon import IG_CLOCK, HEIGHT_PX, STEP_NS, WIDTH_PX, CigiRig, address_of, start  # noqa: E402
from emit_client import FrameClient, HostClient, Pose  # noqa: E402

PATIENCE_S = 60.0
HEADER_BYTES = 128


def get(address, target, host=None):
    connection = http.client.HTTPConnection(address, timeout=PATIENCE_S)
    try:
        connection.putrequest("GET", target, skip_host=True)
        connection.putheader("Host", host or address)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


class Page:
    """A page, as far as its messages go."""

    def __init__(self, address, origin=None):
        self._loop = asyncio.new_event_loop()
        try:
            self._socket = self._run(self._connect(address, origin or f"http://{address}"))
        except BaseException:
            self._loop.close()
            raise

    @staticmethod
    async def _connect(address, origin):
        return await websockets.connect(f"ws://{address}/live", origin=origin, max_size=None)

    def _run(self, work):
        async def wait():
            return await asyncio.wait_for(work, PATIENCE_S)
        return self._loop.run_until_complete(wait())

    def say(self, text):
        self._run(self._socket.send(text))

    def next(self):
        message = self._run(self._socket.recv())
        return message if isinstance(message, bytes) else json.loads(message)

    def next_that(self, wanted):
        """Reads on to a text for which a condition holds."""
        for _ in range(500):
            message = self.next()
            if not isinstance(message, bytes) and wanted(message):
                return message
        raise AssertionError("such a text never came")

    def next_image(self):
        """Reads on to an image. Returns its frame number and its pixels as bytes."""
        for _ in range(500):
            message = self.next()
            if isinstance(message, bytes):
                return struct.unpack_from("<Q", message, 24)[0], message[HEADER_BYTES:]
        raise AssertionError("no image came")

    def answer(self, command):
        self.say(f"command {command}")
        return self.next_that(lambda message: message["type"] == "answer")

    def close(self):
        self._run(self._socket.close())
        self._loop.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class Access(unittest.TestCase):
    def test_serves_its_page_to_its_own_name_and_forbids_it_every_other_host(self):
        with start('mode = "host-step"') as daemon:
            address = address_of(daemon)
            status, headers, body = get(address, "/")
            self.assertEqual(status, 200)
            self.assertIn(b"<title>emitd console</title>", body)
            policy = headers["Content-Security-Policy"]
            self.assertIn("default-src 'none'", policy)
            self.assertIn(f"connect-src 'self' ws://{address};", policy)
            self.assertNotIn("*", policy)
            self.assertEqual(get(address, "/console.js")[1]["Content-Type"], "text/javascript; charset=utf-8")
            self.assertEqual(get(address, "/etc/passwd")[0], 404)
            self.assertEqual(get(address, "/temperatures?channel=99")[0], 404)
            self.assertEqual(get(address, "/", "rebound.example.org")[0], 403)

    def test_takes_websockets_of_its_own_page_alone(self):
        with start('mode = "host-step"') as daemon:
            with self.assertRaises(websockets.InvalidStatusCode) as refused:
                Page(address_of(daemon), "http://example.org")
            self.assertEqual(refused.exception.status_code, 403)
            with Page(address_of(daemon)) as page:
                self.assertEqual(page.next()["type"], "hello")


class Commands(unittest.TestCase):
    def test_take_the_way_of_a_hosts(self):
        with start(IG_CLOCK) as daemon, Page(address_of(daemon)) as page:
            self.assertTrue(page.next()["may_command"])
            page.say("next 0")
            page.next_image()  # the run goes on
            answer = page.answer("step")
            self.assertFalse(answer["ok"], "a run that goes on has no steps")
            answer = page.answer("hold")
            self.assertTrue(answer["ok"], answer)
            page.next_that(lambda message: message["type"] == "status" and message["held"])
            self.assertTrue(page.answer("stop")["ok"])
            page.next_that(lambda message: message["type"] == "status" and not message["running"])
            self.assertTrue(page.answer("step")["ok"])
            self.assertTrue(page.answer("start")["ok"])
            status = page.next_that(lambda message: message["type"] == "status" and message["running"])
            self.assertFalse(status["held"])
            self.assertEqual(status["counters"]["commands"], 4)
            self.assertIn("event=command", daemon.log())

    def test_are_refused_where_the_configuration_says_so(self):
        with start(IG_CLOCK, more='commands = "none"\n') as daemon, Page(address_of(daemon)) as page:
            self.assertFalse(page.next()["may_command"])
            answer = page.answer("stop")
            self.assertEqual((answer["ok"], answer["text"]), (False, "console.commands does not allow it"))
            self.assertTrue(page.next_that(lambda message: message["type"] == "status")["running"])


class Picture(unittest.TestCase):
    def test_is_what_sensor_control_of_a_cigi_host_asks_for(self):
        for kind in (CigiHost, CigiHost4):
            with CigiRig(kind, display_k=(270, 290)) as rig, Page(address_of(rig.daemon)) as page:
                def wanted(picture):
                    page.next_that(lambda message: message["type"] == "status" and message["picture"] == picture)

                rig.step()
                wanted(None)
                rig.step(gain=0.5, level=0.5)
                wanted({"on": True, "black_hot": False, "automatic_gain": False, "low_k": 270.0, "high_k": 290.0})
                rig.step(gain=0.5, level=1.0, black_hot=True)
                wanted({"on": True, "black_hot": True, "automatic_gain": False, "low_k": 280.0, "high_k": 300.0})
                rig.step(gain=0.5, level=0.5, on=False, automatic=True)
                wanted({"on": False, "black_hot": False, "automatic_gain": True, "low_k": 270.0, "high_k": 290.0})
                rig.step()
                wanted({"on": False, "black_hot": False, "automatic_gain": True, "low_k": 270.0, "high_k": 290.0})
                rig.host.send(rig.host.control(0))
                rig.host.wait_mode(0)
                wanted(None)


class Images(unittest.TestCase):
    def test_have_the_floats_that_clients_get(self):
        with start('mode = "host-step"') as daemon, FrameClient.connect(daemon.tcp_url) as client, \
                HostClient.connect(daemon.tcp_url) as host, Page(address_of(daemon)) as page:
            client.subscribe()
            page.say("next 0")
            images = {}
            end_s = time.monotonic() + 1.0  # frames go on until the question has arrived
            while time.monotonic() < end_s:
                number = host.send_pose((len(images) + 1) * STEP_NS, Pose.heading((0.0, 0.0, 100.0), heading_rad=0.0))
                images[number] = client.receive().copy().pixels.tobytes()
                time.sleep(0.01)
            number, pixels = page.next_image()
            self.assertEqual(len(pixels), 4 * WIDTH_PX * HEIGHT_PX)
            self.assertEqual(pixels, images[number])

    def test_come_only_to_a_page_that_asks_so_a_slow_one_loses_only_its_own(self):
        with start(IG_CLOCK) as daemon, FrameClient.connect(daemon.tcp_url) as client, Page(address_of(daemon)) as page:
            page.say("next 0")
            first, _ = page.next_image()
            client.subscribe()
            numbers = [frame.header.frame_number for frame in client.frames(60)]
            self.assertEqual(numbers, list(range(numbers[0], numbers[0] + 60)), "no frame is lost beside it")
            for _ in range(4):
                self.assertNotIsInstance(page.next(), bytes, "it did not ask")
            page.say("next 0")
            newest, _ = page.next_image()
            self.assertGreaterEqual(newest, first + 60)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
