# SPDX-License-Identifier: Apache-2.0
"""A DIS sender and a flight dynamics model, written from the published layouts alone."""
import json
import math
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import tempfile
import time
import unittest
import urllib.request

from daemon import Daemon
from emit_client import FrameClient
from wgs84 import World, axes

ORIGIN = (47.2, 8.6, 450.0)
UNITS_PER_S = (2**31 - 1) / 3600.0
SPEED_M_S = 120.0


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def counter(daemon, name):
    text = urllib.request.urlopen(f"http://{daemon.metrics}/metrics", timeout=20).read().decode()
    for line in text.splitlines():
        if line.startswith(f"emitd_{name}_total "):
            return int(float(line.split()[1]))
    raise AssertionError(f"no counter {name}")


def scenario(test):
    """Returns the head of a configuration with a scenario that says where its world is."""
    folder = tempfile.TemporaryDirectory()
    test.addCleanup(folder.cleanup)
    file = pathlib.Path(folder.name) / "scenario.toml"
    file.write_text(
        f'name = "place"\nepoch_utc = 2026-06-01T10:00:00Z\n[place]\nlat_deg = {ORIGIN[0]}\nlon_deg = {ORIGIN[1]}\n'
        f'height_m = {ORIGIN[2]}\n[sensor]\nwidth_px = 16\nheight_px = 12\n[atmosphere]\nenabled = false\n')
    return f'scenario = "{file}"\n'


def euler_of(north_east_down_from_body, lat_deg, lon_deg):
    """Returns psi, theta and phi of an attitude that is given against north, east and down."""
    east, north, up = axes(lat_deg, lon_deg)
    ned = (north, east, tuple(-u for u in up))  # rows: north, east and down in ECEF
    # Columns of the body's axes in ECEF.
    body = [[sum(ned[k][i] * north_east_down_from_body[k][j] for k in range(3)) for i in range(3)] for j in range(3)]
    psi = math.atan2(body[0][1], body[0][0])
    theta = math.asin(-body[0][2])
    phi = math.atan2(body[1][2], body[2][2])
    return psi, theta, phi


def entity_state(version, exercise, identity, elapsed_s, place_ecef, velocity_ecef, euler, model=2):
    """Makes an Entity State PDU of 144 bytes whose stamp is relative."""
    stamp = (round(elapsed_s * UNITS_PER_S) % 2**31) << 1
    return struct.pack(">BBBBIHH 3HBB 8B8B 3f3d3f IB15s 3f3f B11sI", version, exercise, 1, 1, stamp & 0xffffffff, 144, 0,
                       *identity, 1, 0, *([0] * 16), *velocity_ecef, *place_ecef, *euler, 0, model, bytes(15), 0, 0, 0, 0, 0,
                       0, 1, b"target", 0)


def node_modules():
    """Returns the folder of the packages for Node.js that tests use; None where they are missing."""
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = pathlib.Path(os.environ.get("EMIT_PEERS_DIR") or f"{cache}/emit/peers") / "node_modules"
    return folder if (folder / "open-dis" / "package.json").exists() and shutil.which("node") else None


def by_open_dis(version, states):
    """Returns the PDUs of these arguments of entity_state(), encoded by open-dis."""
    lines = []
    for exercise, identity, elapsed_s, place, velocity, euler in states:
        lines.append(json.dumps({
            "exercise": exercise, "timestamp": (round(elapsed_s * UNITS_PER_S) % 2**31) << 1, "id": identity,
            "location": dict(zip("xyz", place)), "velocity": dict(zip("xyz", velocity)),
            "orientation": dict(zip(("psi", "theta", "phi"), euler))}))
    program = pathlib.Path(__file__).parent / "peers" / "encode_dis.js"
    done = subprocess.run(["node", program, node_modules(), str(version)], input="\n".join(lines), capture_output=True,
                          text=True, timeout=60, check=True)
    return [bytes.fromhex(line) for line in done.stdout.split()]


class OpenDis(unittest.TestCase):
    def test_entities_move_by_pdus_of_another_program(self):
        if node_modules() is None:
            self.skipTest("Node.js or open-dis is missing: install_deps.sh --with-peers installs it")
        for version in (6, 7):
            with self.subTest(version=version):
                self.fly(version)

    def fly(self, version):
        world = World(*ORIGIN)
        # The nose points to the north, and the flight goes there.
        euler = euler_of(((1, 0, 0), (0, 1, 0), (0, 0, 1)), *ORIGIN[:2])
        velocity = [SPEED_M_S * world.axes[1][i] for i in range(3)]
        states = []
        for step in range(31):
            elapsed_s = 0.05 * step
            place = [o + 1000.0 * u + elapsed_s * v for o, u, v in zip(world.origin, world.axes[2], velocity)]
            states.append((3, (1, 2, 9), elapsed_s, place, velocity, euler))
        pdus = by_open_dis(version, states)
        self.assertEqual(len(pdus), len(states))
        listen = free_port()
        more = f'[dis]\nlisten = "127.0.0.1:{listen}"\nexercise = 3\nseeker = "1:2:9"\n[metrics]\nlisten = "127.0.0.1:0"\n'
        with Daemon(16, 12, pacing='mode = "ig-clock"\nrate_hz = 100.0', more=more, head=scenario(self)) as daemon, \
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            client = FrameClient.connect(daemon.tcp_url)
            self.addCleanup(client.close)
            client.subscribe()
            headers = []
            begin_s = time.monotonic()
            for step, pdu in enumerate(pdus):
                sender.sendto(pdu, ("127.0.0.1", listen))
                while time.monotonic() < begin_s + 0.05 * (step + 1):
                    headers.append(client.receive(20.0).header)
            self.assertEqual(counter(daemon, "gateway_messages_refused"), 0)
        moved = [header for header in headers if header.position_m[2] > 900.0]
        self.assertGreater(len(moved), 100)
        lead = [header.position_m[1] - SPEED_M_S * header.sim_time_ns * 1e-9 for header in moved][40:]
        self.assertLess(max(lead) - min(lead), 1.0, "8 ms of flight")
        for header in moved:
            self.assertAlmostEqual(header.position_m[0], 0.0, delta=0.01)
            w, x, y, z = header.world_from_body
            self.assertAlmostEqual(2.0 * (x * y + w * z), 1.0, delta=1e-5)  # the nose's part to the north


class Exercise(unittest.TestCase):
    def run_exercise(self, version):
        world = World(*ORIGIN)
        listen = free_port()
        more = (f'[dis]\nlisten = "127.0.0.1:{listen}"\nexercise = 3\nseeker = "1:2:9"\n'
                '[metrics]\nlisten = "127.0.0.1:0"\n')
        # The nose points to the east.
        east_body = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        euler = euler_of(east_body, *ORIGIN[:2])
        velocity = [SPEED_M_S * world.axes[0][i] for i in range(3)]
        with Daemon(16, 12, pacing='mode = "ig-clock"\nrate_hz = 100.0', more=more,
                    head=scenario(self)) as daemon, \
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            client = FrameClient.connect(daemon.tcp_url)
            self.addCleanup(client.close)
            client.subscribe()
            begin_s = time.monotonic()
            headers = []
            # The stamps wrap after a second.
            first_s = 3599.0
            for step in range(60):
                now_s = time.monotonic() - begin_s
                place = [o + 1000.0 * u + now_s * v for o, u, v in zip(world.origin, world.axes[2], velocity)]
                if step % 3 != 1:
                    sender.sendto(entity_state(version, 3, (1, 2, 9), first_s + now_s, place, velocity, euler),
                                  ("127.0.0.1", listen))
                sender.sendto(entity_state(version, 4, (1, 2, 9), first_s + now_s, (0, 0, 0), velocity, euler),
                              ("127.0.0.1", listen))
                sender.sendto(entity_state(version, 3, (1, 2, 77), first_s + now_s, place, velocity, euler),
                              ("127.0.0.1", listen))
                end_s = begin_s + 0.05 * (step + 1)
                while time.monotonic() < end_s:
                    headers.append(client.receive(20.0).header)
            self.assertEqual(counter(daemon, "gateway_messages_refused"), 0)
            self.assertEqual(counter(daemon, "gateway_packets_unused"), 120)
        moved = [header for header in headers if header.position_m[2] > 900.0 and not header.flags & {"stale"}]
        self.assertGreater(len(moved), 200)
        # All frames lie on one straight flight: the way is the speed times simulation time.
        lead = [header.position_m[0] - SPEED_M_S * header.sim_time_ns * 1e-9 for header in moved]
        settled = lead[40:]
        self.assertLess(max(settled) - min(settled), 1.0, "8 ms of flight")
        for header in moved:
            self.assertAlmostEqual(header.position_m[1], 0.0, delta=0.01)
            self.assertAlmostEqual(header.position_m[2], 1000.0, delta=0.1)
            w, x, y, z = header.world_from_body
            self.assertAlmostEqual(1.0 - 2.0 * (y * y + z * z), 1.0, delta=1e-5)
        self.assertGreater(moved[-1].sim_time_ns, 2_000_000_000)

    def test_version_6_and_stamps_that_wrap(self):
        self.run_exercise(6)

    def test_version_7_and_stamps_that_wrap(self):
        self.run_exercise(7)


class FlightDynamicsModel(unittest.TestCase):
    def test_every_datagram_is_an_image_in_lock_step(self):
        world = World(*ORIGIN)
        listen = free_port()
        more = f'[net_fdm]\nlisten = "127.0.0.1:{listen}"\n[metrics]\nlisten = "127.0.0.1:0"\n'
        with Daemon(16, 12, more=more, head=scenario(self)) as daemon, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            client = FrameClient.connect(daemon.tcp_url)
            self.addCleanup(client.close)
            client.subscribe()
            for step in range(50):
                lat, lon, height = ORIGIN[0] + 1e-4 * step, ORIGIN[1] - 2e-4 * step, 800.0 + step
                data = bytearray(408)
                struct.pack_into(">I", data, 0, 24)
                struct.pack_into(">ddd", data, 8, math.radians(lon), math.radians(lat), height)
                struct.pack_into(">fff", data, 36, 0.0, 0.0, math.radians(90.0))
                struct.pack_into(">fff", data, 76, 10.0, 20.0, 1.0)
                sender.sendto(data, ("127.0.0.1", listen))
                header = client.receive(20.0).header
                for got, wanted in zip(header.position_m, world.point(lat, lon, height)):
                    self.assertAlmostEqual(got, wanted, delta=1e-3)
                sender.sendto(data[:400], ("127.0.0.1", listen))
            self.assertEqual(counter(daemon, "gateway_messages_refused"), 50)
            self.assertEqual(header.host_frame_number, 50)
