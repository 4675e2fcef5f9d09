# SPDX-License-Identifier: Apache-2.0
"""Captures of hosts that do not speak emitd's own messages, played by `emit send --as-captured`."""
import pathlib
import struct
import subprocess
import tempfile
import unittest

from cigi_host import OPERATE, CigiHost
from daemon import BIN_DIR, Daemon
from dis_test import ORIGIN, counter, entity_state, euler_of, free_port, scenario
from emit_client import FrameClient
from wgs84 import World


def pcap(datagrams, port):
    """Returns a capture of UDP datagrams on loopback: (time in us, payload)."""
    out = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 101)
    for time_us, payload in datagrams:
        length = 28 + len(payload)
        packet = struct.pack(">BBHHHBBHII", 0x45, 0, length, 0, 0x4000, 64, 17, 0, 0x7F000001, 0x7F000001)
        packet += struct.pack(">HHHH", 40000, port, 8 + len(payload), 0) + payload
        out += struct.pack("<IIII", 1_700_000_000 + time_us // 10**6, time_us % 10**6, length, length) + packet
    return out


class Captures(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name) / "host.pcap"

    def send(self, port, to, *options):
        return subprocess.run([BIN_DIR / "emit", "send", self.file, "--as-captured", "--host-port", str(port), "--to",
                               f"udp://127.0.0.1:{to}", *options], capture_output=True, text=True, timeout=60,
                              stdin=subprocess.DEVNULL)

    def test_a_dis_exercise_moves_the_seeker_as_it_did(self):
        world = World(*ORIGIN)
        velocity = [100.0 * world.axes[0][i] for i in range(3)]
        euler = euler_of(((1, 0, 0), (0, 1, 0), (0, 0, 1)), *ORIGIN[:2])
        datagrams = []
        for step in range(40):
            time_s = 0.05 * step
            place = [o + 800.0 * u + time_s * v for o, u, v in zip(world.origin, world.axes[2], velocity)]
            datagrams.append((round(time_s * 1e6), entity_state(7, 1, (1, 2, 9), 10.0 + time_s, place, velocity, euler)))
        self.file.write_bytes(pcap(datagrams, 3000))
        listen = free_port()
        more = (f'[dis]\nlisten = "127.0.0.1:{listen}"\nseeker = "1:2:9"\n[metrics]\nlisten = "127.0.0.1:0"\n')
        with Daemon(16, 12, pacing='mode = "ig-clock"\nrate_hz = 100.0', more=more, head=scenario(self)) as daemon:
            client = FrameClient.connect(daemon.tcp_url)
            self.addCleanup(client.close)
            client.subscribe()
            done = self.send(3000, listen)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("40 datagrams sent in 1.9", done.stdout)
            self.assertEqual(counter(daemon, "gateway_datagrams"), 40)
            way = []
            for _ in range(150):
                header = client.receive(20.0).header
                if header.position_m[2] > 700.0:
                    way.append(header.position_m[0] - 100.0 * header.sim_time_ns * 1e-9)
        self.assertGreater(len(way), 100)
        settled = way[40:]
        self.assertLess(max(settled) - min(settled), 1.0)

    def test_a_cigi_host_is_played_at_a_rate(self):
        recorder = CigiHost(("127.0.0.1", 9))
        self.addCleanup(recorder.close)
        datagrams = [(100 * step, recorder.control(OPERATE, ticks=100 * step) +
                      recorder.entity(0, (*ORIGIN[:2], 500.0 + step))) for step in range(30)]
        datagrams.append((9999, b"no message"))
        self.file.write_bytes(pcap(datagrams, 8000))
        listen = free_port()
        more = (f'[cigi]\nlisten = "127.0.0.1:{listen}"\nhost = "127.0.0.1:{recorder.port}"\n'
                '[metrics]\nlisten = "127.0.0.1:0"\n')
        with Daemon(16, 12, more=more, head=scenario(self)) as daemon:
            client = FrameClient.connect(daemon.tcp_url)
            self.addCleanup(client.close)
            client.subscribe()
            done = self.send(8000, listen, "--rate", "100")
            self.assertEqual(done.returncode, 0, done.stderr)
            heights = [client.receive(20.0).header.position_m[2] for _ in range(30)]
            for step, height in enumerate(heights):
                self.assertAlmostEqual(height, 500.0 + step - ORIGIN[2], delta=1e-3)
            self.assertEqual(counter(daemon, "gateway_messages_refused"), 1)

    def test_what_cannot_be_sent_is_said(self):
        self.file.write_bytes(b"time_s,east_m\n")
        done = self.send(3000, 9)
        self.assertEqual(done.returncode, 2)
        self.assertIn("no pcap", done.stderr)
        self.file.write_bytes(pcap([(0, b"x")], 3000))
        done = self.send(3001, 9)
        self.assertEqual(done.returncode, 1)
        self.assertIn("none of 1 packets is a datagram to port 3001", done.stderr)
