# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib
import socket
import struct
import tempfile
import time
import unittest
import urllib.request

from cigi_host import OPERATE, STANDBY, CigiHost, CigiHost4
from daemon import Daemon
from emit_client import FrameClient
from wgs84 import World, axes, dot

ORIGIN = (48.1, 11.3, 400.0)
TICK_S = 1e-5


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def glb(boxes):
    """Returns a glTF file of boxes (x0, y0, z0, x1, y1, z1), in metres west, up and north."""
    positions, indices = [], []
    for x0, y0, z0, x1, y1, z1 in boxes:
        corners = [(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)]
        for a, b, c, d in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)):
            first = len(positions)
            positions += [corners[i] for i in (a, b, c, d)]
            indices += [first, first + 1, first + 2, first, first + 2, first + 3]
    data = struct.pack(f"<{3 * len(positions)}f", *(v for p in positions for v in p))
    data += struct.pack(f"<{len(indices)}I", *indices)
    size = 12 * len(positions)
    lows = [min(p[i] for p in positions) for i in range(3)]
    highs = [max(p[i] for p in positions) for i in range(3)]
    text = json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}], "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": size},
                        {"buffer": 0, "byteOffset": size, "byteLength": len(data) - size}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3", "min": lows,
                       "max": highs},
                      {"bufferView": 1, "componentType": 5125, "count": len(indices), "type": "SCALAR"}]}).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(data)
    return (struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON") + text +
            struct.pack("<I4s", len(data), b"BIN\0") + data)


def rig(order="<", pacing='mode = "host-step"', rate_hz=2000.0, scenario=None, entities="[]", kind=CigiHost):
    """Starts emitd with canned frames, and a host beside it."""
    listen = free_port()
    host = kind(("127.0.0.1", listen), order)
    more = (f'[cigi]\nlisten = "127.0.0.1:{listen}"\nhost = "127.0.0.1:{host.port}"\nrate_hz = {rate_hz}\n'
            f'entities = {entities}\n[metrics]\nlisten = "127.0.0.1:0"\n')
    return Daemon(16, 12, pacing=pacing, more=more, head=f'scenario = "{scenario}"\n' if scenario else ""), host


def subscribed(test, daemon):
    client = FrameClient.connect(daemon.tcp_url)
    test.addCleanup(client.close)
    client.subscribe()
    return client


def counter(daemon, name):
    text = urllib.request.urlopen(f"http://{daemon.metrics}/metrics", timeout=20).read().decode()
    for line in text.splitlines():
        if line.startswith(f"emitd_{name}_total "):
            return int(float(line.split()[1]))
    raise AssertionError(f"no counter {name}")


class Synchronous(unittest.TestCase):
    def run_frames(self, order, count, lost_every, stamped, kind=CigiHost):
        """Every Start Of Frame is answered by a pose. Returns the headers of the frames."""
        daemon, host = rig(order, kind=kind)
        with daemon:
            try:
                client = subscribed(self, daemon)
                first_ticks = 2**32 - 4000 if stamped else None  # they wrap early in the run
                host.begin(first_ticks)
                begun = host.host_frame
                sent, headers = [], []
                for step in range(count):
                    skip = 1 if lost_every and step % lost_every == 5 else 0
                    ticks = None if not stamped else first_ticks + 70 * (host.host_frame + skip)
                    host.send(host.control(OPERATE, ticks=ticks, skip=skip),
                              host.entity(0, (ORIGIN[0], ORIGIN[1], 10.0 + step)), host.unknown())
                    # A Start Of Frame that was on its way already repeats the number before.
                    before = sent[-1] if sent else begun
                    sent.append(host.host_frame)
                    start = host.receive()
                    while start["last_host"] == before:
                        start = host.receive()
                    self.assertEqual(start["last_host"], host.host_frame)
                    self.assertEqual(start["mode"], OPERATE)
                    self.assertEqual((start["order"], start["version"]), (order, 4 if kind is CigiHost4 else 3))
                    headers.append(client.receive(20.0).header)
                self.assertEqual([header.host_frame_number for header in headers], sent)
                self.assertEqual(counter(daemon, "gateway_packets_skipped"), count)
                self.assertEqual(counter(daemon, "gateway_messages_refused"), 0)
                self.assertEqual(counter(daemon, "host_frames_missing"), len(range(5, count, lost_every)) if lost_every else 0)
                return sent, headers
            finally:
                host.close()

    def test_ten_thousand_frames_echo_every_counter(self):
        sent, headers = self.run_frames("<", 10000, 0, False)
        for number, header in zip(sent, headers):
            # The clock starts with the first message in mode operate, which is number 2; a frame has 0.5 ms.
            self.assertEqual(header.sim_time_ns, (number - 2) * 500_000)

    def test_ten_thousand_frames_of_version_4_echo_every_counter(self):
        sent, headers = self.run_frames("<", 10000, 0, False, CigiHost4)
        for number, header in zip(sent, headers):
            self.assertEqual(header.sim_time_ns, (number - 2) * 500_000)

    def test_big_endian_version_4_with_time_stamps_that_wrap_and_messages_that_get_lost(self):
        sent, headers = self.run_frames(">", 1500, 7, True, CigiHost4)
        base = headers[0].sim_time_ns - 70 * 10_000 * sent[0]
        for number, header in zip(sent, headers):
            self.assertEqual(header.sim_time_ns, base + 70 * 10_000 * number)

    def test_big_endian_with_time_stamps_that_wrap_and_messages_that_get_lost(self):
        sent, headers = self.run_frames(">", 1500, 7, True)
        base = headers[0].sim_time_ns - 70 * 10_000 * sent[0]
        for number, header in zip(sent, headers):
            self.assertEqual(header.sim_time_ns, base + 70 * 10_000 * number)

    def test_lost_messages_without_time_stamps_do_not_shift_time(self):
        sent, headers = self.run_frames("<", 700, 7, False)
        for number, header in zip(sent, headers):
            self.assertEqual(header.sim_time_ns, (number - 2) * 500_000)

    def test_standby_forgets_and_a_host_that_comes_back_begins_a_run(self):
        daemon, host = rig()
        with daemon:
            try:
                client = subscribed(self, daemon)
                host.begin()
                host.send(host.control(OPERATE), host.entity(0, (ORIGIN[0], ORIGIN[1], 50.0)))
                host.receive()
                first = client.receive(20.0).header
                host.send(host.control(STANDBY))
                host.wait_mode(STANDBY)
                # In standby nothing but IG Control counts.
                host.send(host.control(STANDBY), host.entity(0, (ORIGIN[0], ORIGIN[1], 60.0)))
                host.wait_mode(STANDBY)
                host.send(host.control(OPERATE))
                host.wait_mode(OPERATE)
                # The seeker is gone: no frame comes, and the host is told why.
                for _ in range(20):
                    host.send(host.control(OPERATE))
                    host.receive()
                self.assertTrue(any("carries the sensor" in text for text in host.texts), host.texts)
                host.send(host.control(OPERATE), host.entity(0, (ORIGIN[0], ORIGIN[1], 70.0)))
                second = client.receive(20.0).header
                self.assertNotEqual(first.run_id, second.run_id)
            finally:
                host.close()

    def test_foreign_senders_and_broken_messages_are_counted_and_change_nothing(self):
        daemon, host = rig()
        with daemon:
            try:
                client = subscribed(self, daemon)
                host.begin()
                broken = (b"", b"\x01", bytes(24), host.control(OPERATE)[:20], b"\x05" + host.control(OPERATE)[1:])
                host.host_frame -= 2  # those two were never sent
                for data in broken:
                    host.send(data)
                host.send(host.control(OPERATE), host.entity(0, (ORIGIN[0], ORIGIN[1], math.nan)),
                          host.entity(0, (ORIGIN[0], ORIGIN[1], 20.0)))
                client.receive(20.0)
                self.assertEqual(counter(daemon, "gateway_messages_refused"), len(broken))
                self.assertEqual(counter(daemon, "gateway_packets_refused"), 1)
                # Messages that were sent before wait in front of the one with the text.
                for _ in range(20):
                    if any("Entity Control" in text and "nan" in text for text in host.texts):
                        break
                    host.receive()
                self.assertTrue(any("Entity Control" in text and "nan" in text for text in host.texts), host.texts)
            finally:
                host.close()


class SensorControl(unittest.TestCase):
    """Sensor Control is for people who look: clients get the same floats, and a tracker that is not there says so."""

    def frames_of(self, kind, wishes):
        """Returns the pixels of frames by their numbers, and what was answered to each."""
        daemon, host = rig(kind=kind)
        with daemon:
            try:
                client = subscribed(self, daemon)
                host.begin()
                images, answers = [], []
                for step, wish in enumerate(wishes):
                    packets = [] if wish is None else [host.sensor(**wish)]
                    host.send(host.control(OPERATE), host.entity(0, (ORIGIN[0], ORIGIN[1], 10.0 + step)), *packets)
                    start = host.receive()
                    while start["last_host"] != host.host_frame:
                        start = host.receive()
                    answers.append([dict(answer, here=answer["frame"] == start["frame"]) for answer in host.answers])
                    frame = client.receive(20.0).copy()
                    images.append((frame.header.frame_number, frame.header.sim_time_ns, frame.header.flags,
                                   frame.header.payload_crc32c, frame.pixels.tobytes()))
                return images, answers, host.texts
            finally:
                host.close()

    def test_frames_are_bit_identical_and_a_tracker_is_answered(self):
        wishes = ([{"gain": 0.1 * i, "level": 1 - 0.1 * i, "black_hot": i % 2 == 1} for i in range(10)] +
                  [{"on": False}, {"automatic": True}, {"noise": 0.5}] +
                  [{"track": 3, "sensor": 4}, {"track": 2, "extended": True}, {"track": 1, "on": False}, {"track": 0}])
        for kind in (CigiHost, CigiHost4):
            plain, _, _ = self.frames_of(kind, [None] * len(wishes))
            images, answers, texts = self.frames_of(kind, wishes)
            self.assertEqual(images, plain)
            self.assertEqual(answers[:13] + answers[15:], [[]] * 15)
            self.assertEqual(answers[13], [{"id": 106, "view": 0, "sensor": 4, "state": 0,
                                            "frame": answers[13][0]["frame"], "here": True}])
            self.assertEqual(answers[14], [{"id": 107, "view": 0, "sensor": 0, "state": 0, "entity": None,
                                            "frame": answers[14][0]["frame"], "here": True}])
            self.assertEqual(sum("tracker" in text for text in texts), 1, texts)
            self.assertEqual(sum("noise" in text for text in texts), 1, texts)


class Asynchronous(unittest.TestCase):
    def test_loss_of_a_fifth_of_the_messages_does_not_shift_time(self):
        daemon, host = rig(pacing='mode = "ig-clock"\nrate_hz = 200.0')
        with daemon:
            try:
                client = subscribed(self, daemon)
                host.begin(1000)
                sent = {}
                begin_s = time.monotonic()
                for step in range(120):
                    elapsed_s = step / 60.0
                    time.sleep(max(0.0, begin_s + elapsed_s - time.monotonic()))
                    host.drain()
                    ticks = 1000 + round(elapsed_s / TICK_S)
                    message = host.control(OPERATE, ticks=ticks)
                    if step % 5 == 3:
                        continue
                    host.send(message, host.entity(0, (ORIGIN[0], ORIGIN[1], 100.0)))
                    sent[host.host_frame] = (ticks - 1000) * 10_000
                last = max(sent)
                for _ in range(2000):
                    header = client.receive(20.0).header
                    if header.host_frame_number in sent:
                        self.assertEqual(header.pose_sim_time_ns, sent[header.host_frame_number])
                    if header.host_frame_number == last:
                        break
                self.assertEqual(header.host_frame_number, last)
                # A message without a time stamp has no time here.
                host.drain()
                host.send(host.control(OPERATE))
                for _ in range(400):
                    host.receive()
                    if any("time stamp" in text for text in host.texts):
                        break
                self.assertTrue(any("time stamp" in text for text in host.texts), host.texts)
            finally:
                host.close()


class Questions(unittest.TestCase):
    """Ground 4 km wide at height 0, a block 10 m high 100 m to the north, and entity 7: a cube of 2 m."""
    kind = CigiHost

    @classmethod
    def setUpClass(cls):
        cls.world = World(*ORIGIN)

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = pathlib.Path(folder.name)
        (path / "ground.glb").write_bytes(glb([(-2000, -5, -2000, 2000, 0, 2000)]))
        (path / "block.glb").write_bytes(glb([(-4, 0, 96, 4, 10, 104)]))
        (path / "cube.glb").write_bytes(glb([(-1, 0, -1, 1, 2, 1)]))
        stone = 'solar_absorptance_frac = 0.6\nemissivity_frac = 0.9\nprescribed_k = 300.0\n'
        scenario = path / "scenario.toml"
        scenario.write_text(
            'name = "questions"\nepoch_utc = 2026-06-01T10:00:00Z\ndefault_material = "soil"\n'
            f'[place]\nlat_deg = {ORIGIN[0]}\nlon_deg = {ORIGIN[1]}\nheight_m = {ORIGIN[2]}\n'
            '[sensor]\nwidth_px = 16\nheight_px = 12\n[atmosphere]\nenabled = false\n'
            f'[[material]]\nname = "soil"\n{stone}[[material]]\nname = "brick"\n{stone}'
            '[[object]]\nname = "ground"\ngltf = "ground.glb"\nmaterial = "soil"\n'
            '[[object]]\nname = "block"\ngltf = "block.glb"\nmaterial = "brick"\n'
            '[[object]]\nname = "cube"\ngltf = "cube.glb"\nmaterial = "brick"\nentity_id = 3\n')
        self.daemon, self.host = rig(scenario=scenario, rate_hz=200.0, entities="[{ id = 7, entity = 3 }]",
                                     kind=self.kind)
        self.addCleanup(self.host.close)
        self.addCleanup(self.daemon.close)
        self.host.begin()

    def ask(self, *packets, told=None):
        """Sends a message with a pose of the sensor, and returns the answers to it. `told` takes the numbers of the
        frames that had any answer."""
        self.host.send(self.host.control(OPERATE), self.host.entity(0, (*ORIGIN[:2], ORIGIN[2] + 50.0)), *packets)
        for _ in range(100):
            start = self.host.receive()
            if told is not None and self.host.answers:
                told.append(start["frame"])
            if start["last_host"] == self.host.host_frame:
                return self.host.answers
        raise AssertionError("no answer")

    def drop(self, place, level_m=0.0):
        """Returns the height of the horizontal plane below a place, along the ellipsoid's vertical."""
        point = self.world.point(*place)
        up = self.world.direction(axes(*place[:2])[2])
        return place[2] - (point[2] - level_m) / up[2]

    def test_heights_are_right_to_a_millimetre(self):
        places = [(48.1, 11.3, 400.0), (48.1003, 11.3004, 812.25), (48.11, 11.31, 300.0), (48.0901, 11.2899, 1e5)]
        requests = []
        for index, place in enumerate(places):
            requests += [self.host.height_request(10 + index, 0, place), self.host.height_request(20 + index, 1, place),
                         self.host.height_request(30 + index, 2, place)]
        answers = {answer["request"]: answer for answer in self.ask(*requests)}
        self.assertEqual(len(answers), 3 * len(places))
        for index, place in enumerate(places):
            hot_m = self.drop(place)
            self.assertTrue(all(answers[base + index]["valid"] for base in (10, 20, 30)), place)
            self.assertEqual(answers[10 + index]["lsn"], self.host.host_frame & 15)
            self.assertFalse(answers[10 + index]["hot"])
            self.assertTrue(answers[20 + index]["hot"])
            self.assertAlmostEqual(answers[10 + index]["height_m"], place[2] - hot_m, delta=1e-3)
            self.assertAlmostEqual(answers[20 + index]["height_m"], hot_m, delta=1e-3)
            self.assertAlmostEqual(answers[30 + index]["hat_m"], place[2] - hot_m, delta=1e-3)
            self.assertAlmostEqual(answers[30 + index]["hot_m"], hot_m, delta=1e-3)
            self.assertGreater(answers[30 + index]["elevation_deg"], 89.9)
            self.assertEqual(answers[30 + index]["material"], 1)

    def test_there_is_no_ground_beyond_the_scene(self):
        answers = self.ask(self.host.height_request(1, 0, (49.0, 11.3, 0.0)))
        self.assertEqual([answer["valid"] for answer in answers], [False])

    def test_the_block_is_ground_and_hides_what_is_behind_it(self):
        world = self.world
        roof = world.place((0.5, 100.0, 40.0))
        south, north = world.place((0.0, 20.0, 4.0)), world.place((0.0, 180.0, 4.0))
        above = world.place((0.0, 180.0, 60.0))
        answers = {answer["request"]: answer for answer in self.ask(
            self.host.height_request(1, 2, roof), self.host.segment_request(2, south, north, True),
            self.host.segment_request(3, south, above), self.host.vector_request(4, south, 0.0, 0.0, extended=True),
            self.host.vector_request(5, south, 0.0, 0.0, max_m=50.0), self.host.vector_request(6, south, 0.0, 89.0))}
        self.assertAlmostEqual(answers[1]["hot_m"], self.drop(roof, 10.0), delta=1e-3)
        self.assertEqual(answers[1]["material"], 2)
        self.assertFalse(answers[2]["visible"])
        self.assertAlmostEqual(answers[2]["range_m"], 76.0, delta=1e-3)
        self.assertTrue(answers[3]["visible"])
        self.assertFalse(answers[3]["valid"])
        # North at the source is the world's north but for the convergence over 20 m.
        north_axis = world.direction(axes(*south[:2])[1])
        expected_m = 76.0 / north_axis[1]
        self.assertAlmostEqual(answers[4]["range_m"], expected_m, delta=1e-3)
        self.assertAlmostEqual(abs(answers[4]["azimuth_deg"]), 180.0, delta=1e-3)
        hit = world.point(*answers[4]["place"])
        self.assertAlmostEqual(hit[1], 96.0, delta=1e-3)
        self.assertFalse(answers[5]["valid"])
        self.assertFalse(answers[6]["valid"])

    def test_entities_are_met_where_they_are_and_answers_know_their_number(self):
        world = self.world
        cube = world.place((30.0, 0.0, 5.0))
        source = world.place((0.0, 0.0, 6.0))
        # The model's y axis is up, so that the cube reaches from 5 m to 7 m.
        self.ask(self.host.entity(7, cube, (40.0, 0.0, 0.0)))
        answers = {answer.get("request"): answer for answer in self.ask(
            self.host.vector_request(1, source, 90.0, 0.0, extended=True, response_relative=True),
            self.host.segment_request(2, source, cube, destination_entity=7),
            self.host.segment_request(3, source, (0.0, 0.0, -1.0), destination_entity=7, destination_relative=True),
            self.host.height_request(4, 0, (0.0, 0.0, -10.0), entity=7), self.host.position_request(7))}
        self.assertEqual(answers[1]["entity"], 7)
        # A square of half width 1 that is turned by 40 degrees, met through its centre.
        half_m = 1.0 / math.cos(math.radians(40.0))
        self.assertAlmostEqual(answers[1]["range_m"], 30.0 - half_m, delta=1e-3)
        offset = answers[1]["place"]
        self.assertAlmostEqual(max(abs(offset[0]), abs(offset[1])), 1.0, delta=1e-3)
        self.assertAlmostEqual(offset[2], -1.0, delta=1e-3)
        # The destination is inside of the target: hidden, by the target itself.
        for request in (2, 3):
            self.assertFalse(answers[request]["visible"])
            self.assertEqual(answers[request]["entity"], 7)
        point = (cube[0], cube[1], cube[2] + 10.0)
        self.assertAlmostEqual(answers[4]["height_m"], point[2] - self.drop(point), delta=1e-3)
        position = [answer for answer in self.host.answers if answer["id"] == 108][0]
        self.assertAlmostEqual(position["place"][2], cube[2], delta=1e-3)
        self.assertAlmostEqual(position["roll_pitch_yaw_deg"][2], 40.0, delta=1e-4)
        # Standby takes it out of the scene.
        gone = self.ask(self.host.entity(7, cube, state=0), self.host.vector_request(1, source, 90.0, 0.0))
        self.assertFalse(gone[0]["valid"] and gone[0]["entity"] == 7)

    def test_periodic_questions_go_on_and_a_clamped_entity_stands_on_the_roof(self):
        world = self.world
        told = []
        answers = self.ask(self.host.height_request(9, 0, (48.1, 11.3, 420.0), period=3), told=told)
        self.assertEqual(len(answers), 1)
        # Frames of the image generator count, also those that this host was too slow for.
        while len(told) < 4:
            self.ask(told=told)
        self.assertEqual([after - before for before, after in zip(told, told[1:])], [3] * (len(told) - 1))
        roof = world.place((0.0, 100.0, 0.0))
        self.ask(self.host.entity(7, (roof[0], roof[1], 0.5), clamp=1))
        self.ask(self.host.position_request(7))
        position = [answer for answer in self.host.answers if answer["id"] == 108][0]
        self.assertAlmostEqual(position["place"][2], self.drop(roof, 10.0) + 0.5, delta=1e-3)

    def test_a_date_moves_the_time_of_day_and_begins_a_run(self):
        client = subscribed(self, self.daemon)
        self.ask()
        before = client.receive(20.0).header
        self.ask(self.host.sky(13, 30, 6, 1, 2026))
        after = client.receive(20.0).header
        self.assertEqual(after.sim_time_ns, int(3.5 * 3600e9))
        self.assertNotEqual(before.run_id, after.run_id)
        # The same minute again changes nothing.
        self.ask(self.host.sky(13, 30, 6, 1, 2026))
        again = client.receive(20.0).header
        self.assertEqual(again.run_id, after.run_id)
        self.assertEqual(again.sim_time_ns, after.sim_time_ns + 5_000_000)

    def test_what_has_no_effect_is_said_once(self):
        for _ in range(3):
            self.ask(self.host.ellipsoid(6.4e6, 0.003), self.host.entity(99, ORIGIN))
        self.assertEqual(sum("Earth Reference Model" in text for text in self.host.texts), 1, self.host.texts)
        self.assertEqual(sum("entity 99" in text for text in self.host.texts), 1, self.host.texts)
        self.assertEqual(counter(self.daemon, "gateway_packets_unused"), 3)
        self.assertEqual(counter(self.daemon, "gateway_unknown_entities"), 1)


class QuestionsInVersion4(unittest.TestCase):
    """The same scene with a host of version 4.0."""
    kind = CigiHost4
    setUpClass = classmethod(Questions.setUpClass.__func__)
    setUp, ask, drop = Questions.setUp, Questions.ask, Questions.drop
    test_heights = Questions.test_heights_are_right_to_a_millimetre
    test_block = Questions.test_the_block_is_ground_and_hides_what_is_behind_it

    def test_a_date_counts_seconds(self):
        client = subscribed(self, self.daemon)
        self.ask()
        client.receive(20.0)
        self.ask(self.host.sky(13, 30, 6, 1, 2026, 12.5))
        self.assertEqual(client.receive(20.0).header.sim_time_ns, int((3.5 * 3600 + 12.5) * 1e9))
