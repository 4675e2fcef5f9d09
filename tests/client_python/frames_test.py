# SPDX-License-Identifier: Apache-2.0
import signal
import socket
import time
import unittest

import numpy as np
from daemon import Daemon, ToolReceiver
from emit_client import (ArgumentError, ClosedError, ConnectError, DeadlineError, EmitError, FrameClient, HostClient,
                         OverwrittenError, Pose, ProtocolError, RefusedError)

IG_CLOCK = 'mode = "ig-clock"\nrate_hz = 200.0'
STEP_NS = 5_000_000


def pose(number):
    return Pose.heading((10.0 * number, -1.0, 100.0), heading_rad=0.1 * number)


def drop(client, is_lost):
    """Loses the datagrams of a UDP client that are chosen by their byte offset and flags. Returns their offsets."""
    take, dropped = client._reassembler.push_joined, []

    def take_others(data, segment_bytes):
        for begin in range(0, len(data), segment_bytes):
            datagram = data[begin:begin + segment_bytes]
            offset = int.from_bytes(datagram[12:16].tobytes(), "little")
            if is_lost(offset, int(datagram[5])):
                dropped.append(offset)
            else:
                take(datagram, len(datagram))

    client._reassembler.push_joined = take_others
    return dropped


class SameFrames(unittest.TestCase):
    def test_every_transport_gives_what_the_cpp_tool_gets(self):
        """One pose at a time, so that nobody skips: all three transports and the tool get the same bytes."""
        count = 6
        with Daemon(160, 120) as daemon:
            tool = ToolReceiver(daemon, daemon.tcp_url, count)
            clients = {}
            try:
                tool.wait_subscribed()
                for name, url in daemon.frame_urls.items():
                    clients[name] = FrameClient.connect(url)
                    self.assertEqual(clients[name].server.pacing, "host-step")
                    channel = clients[name].subscribe()
                    self.assertEqual((channel.width_px, channel.height_px), (160, 120))
                frames = {name: [] for name in clients}
                with HostClient.connect(daemon.tcp_url) as host:
                    for number in range(1, count + 1):
                        self.assertEqual(host.send_pose(number * STEP_NS, pose(number)), number)
                        for name, client in clients.items():
                            frames[name].append(client.receive().copy())
                images, results = tool.wait()
            finally:
                tool.close()
                for client in clients.values():
                    client.close()
        self.assertEqual(results["counters"]["received"], count)
        self.assertEqual(sorted(images), list(range(1, count + 1)))
        for name, got in frames.items():
            for number, frame in enumerate(got, 1):
                header = frame.header
                self.assertEqual((header.frame_number, header.host_frame_number), (number, number), name)
                self.assertEqual(header.sim_time_ns, number * STEP_NS, name)
                self.assertLessEqual({"canned"}, header.flags, name)
                self.assertFalse(header.flags & {"partial", "corrupt", "lost_before", "gap_before"}, name)
                self.assertEqual(frame.pixels.tobytes(), images[number].tobytes(), f"{name}, frame {number}")
            self.assertNotEqual(got[0].pixels.tobytes(), got[1].pixels.tobytes())

    def test_steady_stream_loses_nothing_silently(self):
        with Daemon(640, 512, IG_CLOCK) as daemon:
            for name, url in daemon.frame_urls.items():
                with self.subTest(transport=name), FrameClient.connect(url) as client:
                    client.subscribe()
                    begin_s = time.monotonic()
                    numbers = [frame.header.frame_number for frame in client.frames(100)]
                    rate_hz = 99 / (time.monotonic() - begin_s)
                    print(f"{name}: {rate_hz:.0f} frames/s of 640x512, {client.counters}")
                    counters = client.counters
                    self.assertEqual(counters.received + counters.partial, 100)
                    faults = (counters.crc_errors, counters.bad_datagrams, counters.foreign_datagrams)
                    self.assertEqual(faults, (0, 0, 0))
                    # Frames may be skipped on a busy machine, but never silently.
                    missing = numbers[-1] - numbers[0] + 1 - len(numbers)
                    self.assertEqual(missing, counters.lost + counters.skipped)

    def test_every_nth_frame(self):
        with Daemon(pacing=IG_CLOCK) as daemon:
            for name, url in daemon.frame_urls.items():
                with self.subTest(transport=name), FrameClient.connect(url) as client:
                    client.subscribe(every_nth=5)
                    self.assertEqual(client.terms.every_nth, 5)
                    self.assertEqual({frame.header.frame_number % 5 for frame in client.frames(5)}, {1})
                    self.assertEqual(client.counters.lost, 0)

    def test_without_checksum(self):
        with Daemon(pacing=IG_CLOCK) as daemon:
            for url in daemon.frame_urls.values():
                with FrameClient.connect(url, check_crc=False) as client:
                    client.subscribe()
                    self.assertEqual(len(list(client.frames(3))), 3)

    def test_small_and_large_fragments(self):
        with Daemon(pacing=IG_CLOCK) as daemon:
            for payload_bytes in (384, 8900, 65472):
                with FrameClient.connect(daemon.udp_url) as client:
                    client.subscribe(fragment_payload_bytes=payload_bytes)
                    self.assertEqual(client.terms.fragment_payload_bytes, payload_bytes)
                    self.assertEqual(len(list(client.frames(5))), 5)
                    self.assertEqual(client.counters.partial, 0)


class Networks(unittest.TestCase):
    def test_two_clients_of_a_multicast_group(self):
        with Daemon(pacing=IG_CLOCK) as daemon:
            with FrameClient.connect(daemon.udp_url) as first, FrameClient.connect(daemon.udp_url) as second:
                first.subscribe(multicast_group="239.255.77.1")
                # The port of the group carries the other stream too, which is foreign.
                second.subscribe(multicast_group="239.255.77.1", udp_port=first.terms.udp_port)
                for client in (first, second):
                    self.assertEqual(len(list(client.frames(10))), 10)
                    self.assertEqual(client.counters.partial, 0)
                    self.assertGreater(client.counters.foreign_datagrams, 0)

    def test_ipv6(self):
        try:
            with socket.socket(socket.AF_INET6) as probe:
                probe.bind(("::1", 0))
        except OSError:
            self.skipTest("this machine has no IPv6")
        with Daemon(address="[::1]") as daemon:
            for url, host_url in ((daemon.tcp_url, daemon.tcp_url), (daemon.udp_url, daemon.host_url)):
                with FrameClient.connect(url) as client, HostClient.connect(host_url) as host:
                    client.subscribe()
                    for number in range(1, 4):
                        host.send_pose(number * STEP_NS, pose(number))
                        self.assertEqual(client.receive().header.host_frame_number, number)
                    self.assertEqual(client.counters.foreign_datagrams, 0)

    def test_strangers_and_a_flood_do_not_hold_the_caller(self):
        with Daemon() as daemon, FrameClient.connect(daemon.udp_url) as client:
            client.subscribe()
            where = ("127.0.0.1", client.terms.udp_port)
            with socket.socket(type=socket.SOCK_DGRAM) as stranger:
                stranger.bind(("127.0.0.2", 0))
                for _ in range(10):
                    stranger.sendto(bytes(40), where)
            with socket.socket(type=socket.SOCK_DGRAM) as local:
                for datagram in (b"", b"x", bytes(40)):
                    local.sendto(datagram, where)
            self.assertIsNone(client.receive(0.05))
            self.assertEqual((client.counters.foreign_datagrams, client.counters.bad_datagrams), (10, 3))
            take, client._take = client._take, lambda: True
            begin_s = time.monotonic()
            self.assertIsNone(client.receive(0.05))
            self.assertLess(time.monotonic() - begin_s, 5)
            client._take = take


class SharedMemory(unittest.TestCase):
    def test_pixels_in_place_say_when_they_are_overwritten(self):
        with Daemon(pacing=IG_CLOCK) as daemon, FrameClient.connect(daemon.shm_url) as client:
            client.subscribe()
            frame = client.receive()
            self.assertFalse(frame.pixels.flags.writeable)
            self.assertFalse(frame.pixels.flags.owndata)
            copied = frame.copy()
            self.assertTrue(copied.pixels.flags.owndata)
            with frame.checked() as pixels:
                self.assertTrue(np.array_equal(pixels, copied.pixels))
            with self.assertRaisesRegex(OverwrittenError, f"frame {frame.header.frame_number}"):
                with frame.checked():
                    end_s = time.monotonic() + 10
                    while frame.still_valid() and time.monotonic() < end_s:
                        time.sleep(0.005)
            self.assertFalse(frame.still_valid())
            self.assertRaises(OverwrittenError, frame.copy)
            self.assertTrue(copied.still_valid())
            # The reader was overtaken, goes on with the newest frame, and says so.
            self.assertIn("gap_before", client.receive().header.flags)
            self.assertEqual(client.counters.gaps, 1)
            self.assertEqual(client.counters.lost, 0)

    def test_copies_on_request(self):
        with Daemon(pacing=IG_CLOCK) as daemon, FrameClient.connect(daemon.shm_url) as client:
            client.subscribe(in_place=False)
            frame = client.receive()
            self.assertTrue(frame.pixels.flags.writeable)
            self.assertTrue(frame.still_valid())

    def test_every_frame_ends_where_the_reader_falls_behind(self):
        with Daemon(pacing=IG_CLOCK) as daemon, FrameClient.connect(daemon.shm_url) as client:
            client.subscribe(every_frame=True)
            frame = client.receive()
            while frame.still_valid():
                time.sleep(0.005)
            with self.assertRaisesRegex(ClosedError, "fell behind by more than the 8 frames it holds"):
                client.receive()

    def test_frames_outlive_the_client_and_the_daemon_learns_that_nobody_reads(self):
        with Daemon(pacing=IG_CLOCK) as daemon:
            client = FrameClient.connect(daemon.shm_url)
            client.subscribe()
            frame = client.receive()
            client.close()
            self.assertGreater(float(frame.pixels.sum()), 0)
            # The daemon writes nothing while nobody reads, so nothing overwrites the frame.
            time.sleep(0.1)
            still = frame.still_valid()
            time.sleep(0.1)
            self.assertEqual(frame.still_valid(), still)
            with FrameClient.connect(daemon.shm_url) as again:
                again.subscribe()
                self.assertIsNotNone(again.receive())

    def test_waiting_does_not_spin(self):
        with Daemon() as daemon, FrameClient.connect(daemon.shm_url) as client:
            client.subscribe()
            begin_s, cpu_s = time.monotonic(), time.process_time()
            self.assertIsNone(client.receive(0.5))
            self.assertGreaterEqual(time.monotonic() - begin_s, 0.5)
            self.assertLess(time.process_time() - cpu_s, 0.1)


class SlowClient(unittest.TestCase):
    def test_stopped_over_tcp_is_told_of_the_gap(self):
        with Daemon(640, 512, IG_CLOCK) as daemon, FrameClient.connect(daemon.tcp_url) as client:
            client.subscribe()
            first = client.receive().header.frame_number
            time.sleep(0.5)
            end_s = time.monotonic() + 30
            while client.counters.gaps == 0 and time.monotonic() < end_s:
                last = client.receive().header.frame_number
            counters = client.counters
            self.assertGreaterEqual(counters.gaps, 1)
            self.assertGreater(counters.skipped, 0)
            self.assertEqual(counters.lost, 0)
            self.assertEqual(last - first + 1, counters.received + counters.skipped)

    def test_stopped_over_udp_counts_what_the_kernel_dropped(self):
        with Daemon(640, 512, IG_CLOCK) as daemon, FrameClient.connect(daemon.udp_url) as client:
            client.subscribe()
            self.assertGreater(client.receive_buffer_bytes, 0)
            first = client.receive().header.frame_number
            time.sleep(0.5)
            end_s = time.monotonic() + 30
            # The frames before the loss are still in the buffer.
            while client.counters.lost == 0 and time.monotonic() < end_s:
                frame = client.receive()
            counters = client.counters
            self.assertGreater(counters.os_drops, 0)
            self.assertGreater(counters.lost, 0)
            self.assertIn("lost_before", frame.header.flags)
            self.assertEqual(frame.header.frame_number - first + 1,
                             counters.received + counters.partial + counters.lost + counters.skipped)

    def test_every_frame_over_tcp_disconnects(self):
        with Daemon(640, 512, IG_CLOCK) as daemon, FrameClient.connect(daemon.tcp_url) as client:
            client.subscribe(every_frame=True)
            client.receive()
            time.sleep(0.5)
            with self.assertRaises(ClosedError):
                for _ in client.frames(400):
                    pass


class Resend(unittest.TestCase):
    def test_dropped_fragments_come_again(self):
        with Daemon(640, 512) as daemon, FrameClient.connect(daemon.udp_url) as client, HostClient.connect(
                daemon.tcp_url) as host:
            client.subscribe(resend=True)
            self.assertTrue(client.terms.resend)
            length = client.terms.fragment_payload_bytes
            places = [3 * length, 100 * length, 101 * length]
            dropped = drop(client, lambda offset, flags: offset in places and not flags & 8)
            for number in range(1, 4):
                host.send_pose(number * STEP_NS, pose(number))
                frame = client.receive()
                self.assertEqual(frame.header.flags & {"partial", "corrupt"}, set())
                self.assertEqual(frame.resent_fragments, 3)
            self.assertEqual(dropped, 3 * places)
            self.assertEqual(client.counters.resent, 9)
            self.assertEqual(client.counters.partial, 0)

    def test_is_not_granted_to_a_steady_stream(self):
        with Daemon(pacing=IG_CLOCK) as daemon, FrameClient.connect(daemon.udp_url) as client:
            client.subscribe(resend=True)
            self.assertFalse(client.terms.resend)

    def test_without_it_a_hole_is_a_partial_frame(self):
        with Daemon(640, 512) as daemon, FrameClient.connect(daemon.udp_url) as client, HostClient.connect(
                daemon.tcp_url) as host:
            client.subscribe()
            drop(client, lambda offset, flags: flags & 2)
            host.send_pose(STEP_NS, pose(1))
            begin_s = time.monotonic()
            frame = client.receive()
            # It is handed out when nothing more came for a quarter of a second.
            self.assertGreater(time.monotonic() - begin_s, 0.2)
            self.assertEqual(frame.header.flags & {"partial", "corrupt"}, {"partial"})
            self.assertEqual(client.counters.partial, 1)


class End(unittest.TestCase):
    def test_daemon_ends_or_is_killed_in_mid_stream(self):
        for number in (signal.SIGTERM, signal.SIGKILL):
            for name in ("tcp", "udp", "shm"):
                with self.subTest(transport=name, signal=number), Daemon(pacing=IG_CLOCK) as daemon:
                    with FrameClient.connect(daemon.frame_urls[name]) as client:
                        client.subscribe()
                        client.receive()
                        daemon.stop(number)
                        with self.assertRaises(ClosedError) as raised:
                            for _ in client.frames(1000, timeout_s=5):
                                pass
                        self.assertIn(daemon.shm if name == "shm" else daemon.control, str(raised.exception))
                        self.assertRaises(ClosedError, client.receive)

    def test_closed_client(self):
        with Daemon() as daemon:
            for url in daemon.frame_urls.values():
                client = FrameClient.connect(url)
                client.subscribe()
                client.close()
                client.close()
                self.assertRaisesRegex(ClosedError, "closed by this client", client.receive)
            host = HostClient.connect(daemon.host_url)
            host.close()
            self.assertRaises(ClosedError, host.send_pose, 1, Pose())


class Wrong(unittest.TestCase):
    def test_urls(self):
        for url in ("", "127.0.0.1:7000", "tcp://127.0.0.1", "tcp://:7000", "tcp://host:0", "tcp://host:65536",
                    "udp://host:7000/x", "http://host:1", "shm://", "shm://../x", "shm://-x", "tcp://[::1:7000"):
            with self.assertRaisesRegex(ArgumentError, "not .*shm://name"):
                FrameClient.connect(url)
        with self.assertRaisesRegex(ArgumentError, "'shm://x': not tcp://host:port or udp://host:port"):
            HostClient.connect("shm://x")

    def test_port_where_nobody_listens(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            where = f"127.0.0.1:{free.getsockname()[1]}"
            for url in (f"tcp://{where}", f"udp://{where}"):
                with self.assertRaisesRegex(ConnectError, f"{where}: Connection refused"):
                    FrameClient.connect(url)
            with self.assertRaisesRegex(ConnectError, where):
                HostClient.connect(f"tcp://{where}")
        with self.assertRaisesRegex(ConnectError, 'no emitd on this host has stream.shm = "no-such-name"'):
            FrameClient.connect("shm://no-such-name")

    def test_port_of_something_silent(self):
        with socket.socket() as silent:
            silent.bind(("127.0.0.1", 0))
            silent.listen()
            where = f"127.0.0.1:{silent.getsockname()[1]}"
            with self.assertRaisesRegex(DeadlineError, f"{where}: no welcome within the timeout"):
                FrameClient.connect(f"tcp://{where}", timeout_s=0.1)

    def test_port_of_another_protocol(self):
        with Daemon(more='[metrics]\nlisten = "127.0.0.1:0"\n') as daemon:
            metrics = daemon.metrics
            with self.assertRaisesRegex(EmitError, metrics) as raised:
                FrameClient.connect(f"tcp://{metrics}", timeout_s=10)
            self.assertIsInstance(raised.exception, (ProtocolError, ClosedError))

    def test_subscriptions(self):
        with Daemon() as daemon:
            for url in daemon.frame_urls.values():
                with FrameClient.connect(url) as client:
                    self.assertRaisesRegex(ArgumentError, "subscribe comes before receive", client.receive)
                    self.assertRaisesRegex(ArgumentError, "every_nth is 1001", client.subscribe, every_nth=1001)
                    self.assertRaisesRegex(ArgumentError, "timeout_s is -1", client.subscribe, timeout_s=-1)
                    with self.assertRaisesRegex(RefusedError, "no-such-band"):
                        client.subscribe(band="no-such-band")
                with FrameClient.connect(url) as client:
                    client.subscribe(channel_kind="injection")
                    self.assertRaisesRegex(ArgumentError, "already subscribed", client.subscribe)
            with FrameClient.connect(daemon.udp_url) as client:
                self.assertRaisesRegex(ArgumentError, "'10.0.0.1' is not a multicast group", client.subscribe,
                                       multicast_group="10.0.0.1")

    def test_timeouts(self):
        with Daemon() as daemon:
            for name, url in daemon.frame_urls.items():
                with self.subTest(transport=name), FrameClient.connect(url) as client:
                    client.subscribe()
                    self.assertIsNone(client.receive(0))
                    begin_s = time.monotonic()
                    self.assertIsNone(client.receive(0.05))
                    self.assertGreaterEqual(time.monotonic() - begin_s, 0.05)
                    with self.assertRaisesRegex(DeadlineError, "no frame within 0.05 s"):
                        next(client.frames(timeout_s=0.05))
                    with HostClient.connect(daemon.tcp_url) as host:
                        host.send_pose(STEP_NS, pose(1))
                        self.assertEqual(client.receive().header.host_frame_number, 1)


if __name__ == "__main__":
    unittest.main()
