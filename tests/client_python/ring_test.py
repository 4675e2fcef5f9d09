# SPDX-License-Identifier: Apache-2.0
"""Shared memory that the test writes itself, as a daemon would."""
import contextlib
import fcntl
import mmap
import os
import random
import struct
import unittest
import uuid

import numpy as np
from emit_client import (ClosedError, ConnectError, EmitError, FrameClient, OverwrittenError, ProtocolError,
                         RefusedError, crc32c)
from emit_client.messages import control_pb2
from wire import frame_header

WIDTH_PX, HEIGHT_PX = 16, 8
SLOTS = 4
PAGE_BYTES = 4096


class Ring:
    """A ring of two channels, which have pixels of their own."""

    def __init__(self):
        self.name = f"test-{uuid.uuid4().hex[:12]}"
        self.url = f"shm://{self.name}"
        self.path = f"/dev/shm/emitd-{self.name}"
        channels = [control_pb2.ChannelInfo(name=name, kind="injection", band="a", width_px=WIDTH_PX,
                                            height_px=HEIGHT_PX) for name in ("first", "second")]
        welcome = control_pb2.Welcome(protocol_version=1, software="test", channels=channels).SerializeToString()
        self.slot_bytes = 3 * PAGE_BYTES
        self.slots_offset = PAGE_BYTES
        self.entries = [(64 + 384 * i, PAGE_BYTES * (1 + i), 4 * WIDTH_PX * HEIGHT_PX) for i in range(2)]
        total = self.slots_offset + SLOTS * self.slot_bytes
        self.head = struct.pack("<IHHIIQQQQQQq", 0x534D4645, 2, 0, SLOTS, 2, total, self.slot_bytes, self.slots_offset,
                                192, 192 + 64, len(welcome), 1)
        self.fd = os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600)
        os.ftruncate(self.fd, total)
        self.lock(fcntl.F_WRLCK)
        self.memory = mmap.mmap(self.fd, total)
        self.memory[:len(self.head)] = self.head
        struct.pack_into("<II", self.memory, 128, 0, 1)
        table = b"".join(struct.pack("<QQQQ", *entry, 0) for entry in self.entries)
        self.memory[192:192 + len(table)] = table
        self.memory[256:256 + len(welcome)] = welcome
        self.publication = 0

    def lock(self, kind):
        fcntl.fcntl(self.fd, fcntl.F_OFD_SETLK, struct.pack("hhqqi4x", kind, os.SEEK_SET, 0, 1, 0))

    def is_read(self):
        probe = os.open(self.path, os.O_RDWR)
        try:
            answer = fcntl.fcntl(probe, fcntl.F_OFD_GETLK, struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 1, 1, 0))
            return struct.unpack_from("h", answer)[0] == fcntl.F_RDLCK
        finally:
            os.close(probe)

    def begin(self):
        self.publication += 1
        struct.pack_into("<Q", self.memory, self.slot(), 2 * self.publication - 1)

    def slot(self):
        return self.slots_offset + self.publication % SLOTS * self.slot_bytes

    def commit(self):
        struct.pack_into("<Q", self.memory, self.slot(), 2 * self.publication)
        struct.pack_into("<Q", self.memory, 136, self.publication)
        signal, = struct.unpack_from("<I", self.memory, 128)
        struct.pack_into("<I", self.memory, 128, signal + 1)

    def publish(self, number, channels=(0, 1), **fields):
        self.begin()
        for channel, (header_at, pixels_at, length) in enumerate(self.entries):
            pixels = np.full((HEIGHT_PX, WIDTH_PX), 10.0 * number + channel, np.float32)
            header = frame_header(**{"width_px": WIDTH_PX, "height_px": HEIGHT_PX, "frame_number": number,
                                     "channel_index": channel, "payload_crc32c": crc32c(pixels), **fields})
            at = self.slot() + header_at
            self.memory[at:at + 384] = header if channel in channels else bytes(384)
            at = self.slot() + pixels_at
            self.memory[at:at + length] = pixels.tobytes()
        self.commit()

    def close(self):
        self.memory.close()
        os.close(self.fd)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.path)


class Case(unittest.TestCase):
    def setUp(self):
        self.ring = Ring()
        self.addCleanup(self.ring.close)

    def client(self, **options):
        client = FrameClient.connect(self.ring.url)
        self.addCleanup(client.close)
        client.subscribe(**options)
        return client


class Reading(Case):
    def test_frames_of_the_channel_that_was_asked_for(self):
        self.ring.publish(1)
        client = self.client(channel_name="second")
        # The frame that was there before is old.
        self.assertIsNone(client.receive(0))
        for number in (2, 3, 4, 5, 6):
            self.ring.publish(number)
            frame = client.receive(0)
            self.assertEqual((frame.header.frame_number, frame.header.channel_index), (number, 1))
            self.assertEqual(float(frame.pixels[3, 4]), 10.0 * number + 1)
            self.assertEqual(frame.header.flags, set())
        self.assertEqual(client.counters.received, 5)

    def test_a_frame_without_this_channel_is_left_out(self):
        client = self.client(channel_name="second")
        self.ring.publish(1, channels=(0,))
        self.assertIsNone(client.receive(0))
        self.ring.publish(2, flag_bits=1 << 9)
        self.assertEqual(client.receive(0).header.flags, {"gap_before"})

    def test_an_unfinished_frame_is_not_given(self):
        client = self.client()
        self.ring.begin()
        self.assertIsNone(client.receive(0.01))
        self.ring.commit()
        # The header there is no frame's.
        self.assertIsNone(client.receive(0))

    def test_an_overtaken_reader_goes_on_with_the_newest(self):
        client = self.client()
        self.ring.publish(1)
        first = client.receive(0)
        for number in range(2, 10):
            self.ring.publish(number)
        self.assertFalse(first.still_valid())
        self.assertRaises(OverwrittenError, first.copy)
        frame = client.receive(0)
        self.assertEqual(frame.header.frame_number, 9)
        self.assertEqual(frame.header.flags, {"gap_before"})
        self.assertEqual((client.counters.gaps, client.counters.skipped, client.counters.lost), (1, 7, 0))
        self.assertTrue(frame.still_valid())
        self.ring.begin()
        self.assertTrue(frame.still_valid())

    def test_three_frames_are_there_for_a_reader_of_four_slots(self):
        client = self.client()
        for number in (1, 2, 3):
            self.ring.publish(number)
        self.assertEqual([client.receive(0).header.frame_number for _ in range(3)], [1, 2, 3])
        self.assertEqual(client.counters.gaps, 0)

    def test_every_nth(self):
        client = self.client(every_nth=3)
        numbers = []
        for number in range(1, 12):
            self.ring.publish(number)
            frame = client.receive(0)
            if frame is not None:
                numbers.append(frame.header.frame_number)
        self.assertEqual(numbers, [1, 4, 7, 10])

    def test_wrong_checksum(self):
        client = self.client()
        self.ring.publish(1, payload_crc32c=1)
        self.assertEqual(client.receive(0).header.flags, {"corrupt"})

    def test_the_daemon_ends_or_is_gone(self):
        client = self.client()
        self.ring.publish(1)
        struct.pack_into("<I", self.ring.memory, 132, 2)
        # The last frame comes first.
        self.assertEqual(client.receive(0).header.frame_number, 1)
        self.assertRaisesRegex(ClosedError, "closed by the daemon", client.receive)
        struct.pack_into("<I", self.ring.memory, 132, 1)
        self.ring.lock(fcntl.F_UNLCK)
        self.assertRaisesRegex(ClosedError, "gone without closing it", client.receive)

    def test_the_lock_of_a_reader_ends_with_the_client(self):
        self.assertFalse(self.ring.is_read())
        client = self.client()
        self.assertTrue(self.ring.is_read())
        self.ring.publish(1)
        frame = client.receive(0)
        client.close()
        self.assertFalse(self.ring.is_read())
        self.assertEqual(float(frame.pixels[0, 0]), 10.0)


class Refused(Case):
    def expect(self, error, text):
        self.assertRaisesRegex(error, text, FrameClient.connect, self.ring.url)
        self.assertFalse(self.ring.is_read())

    def test_unknown_channel(self):
        with FrameClient.connect(self.ring.url) as client:
            self.assertRaisesRegex(RefusedError, "no channel name '' kind '' sensor '' band 'b'", client.subscribe,
                                   band="b")

    def test_left_behind(self):
        self.ring.lock(fcntl.F_UNLCK)
        self.expect(ConnectError, "left behind by an emitd that is gone")

    def test_heads(self):
        for offset, layout, value, text in (
                (0, "<I", 1, "not a ring of frames"), (4, "<H", 3, "ring version 3, this reader knows 2"),
                (8, "<I", 2, "contradicts itself"), (8, "<I", 1000, "contradicts itself"),
                (12, "<I", 2000, "contradicts itself"), (12, "<I", 1, "a ring without its welcome"),
                (16, "<Q", 2**40, "contradicts itself"), (24, "<Q", 64 * 1000, "contradicts itself"),
                (24, "<Q", 65, "contradicts itself"), (32, "<Q", 2**63, "contradicts itself"),
                (40, "<Q", 2**63, "contradicts itself"), (48, "<Q", 2**63, "contradicts itself"),
                (56, "<Q", 2**63, "contradicts itself"), (192, "<Q", 0, "outside its slots"),
                (200, "<Q", 2**63, "outside its slots"), (208, "<Q", 2**63, "outside its slots")):
            kept = self.ring.memory[:512]
            struct.pack_into(layout, self.ring.memory, offset, value)
            with self.subTest(offset=offset, value=value):
                self.expect(ProtocolError, text)
            self.ring.memory[:512] = kept

    def test_changed_heads_raise_nothing_but_errors_of_the_package(self):
        chance = random.Random(9)
        self.ring.publish(1)
        kept = self.ring.memory[:512]
        for _ in range(300):
            for _ in range(chance.randint(1, 3)):
                self.ring.memory[chance.randrange(512)] = chance.randrange(256)
            with contextlib.suppress(EmitError), FrameClient.connect(self.ring.url) as client:
                client.subscribe()
                client.receive(0)
            self.ring.memory[:512] = kept


if __name__ == "__main__":
    unittest.main()
