# SPDX-License-Identifier: Apache-2.0
"""The client against a daemon of a few lines, which sends what a real one does not."""
import contextlib
import random
import socket
import threading
import unittest

import numpy as np
from emit_client import ClosedError, DeadlineError, EmitError, FrameClient, ProtocolError, RefusedError, crc32c
from emit_client.messages import control_pb2
from wire import frame_header, record

WIDTH_PX, HEIGHT_PX = 8, 4


def control(**body):
    return record(1, control_pb2.ControlRecord(**body).SerializeToString())


def channel(**fields):
    return control_pb2.ChannelInfo(**{"name": "a", "kind": "injection", "width_px": WIDTH_PX, "height_px": HEIGHT_PX,
                                      **fields})


def welcome(version=1):
    return control(welcome=control_pb2.Welcome(protocol_version=version, software="fake", channels=[channel()]))


def subscribed(**fields):
    return control(subscribed=control_pb2.Subscribed(**{"channel": channel(), "every_nth": 1, **fields}))


def frame(number, **fields):
    pixels = np.full((HEIGHT_PX, WIDTH_PX), float(number), np.float32)
    header = frame_header(**{"width_px": WIDTH_PX, "height_px": HEIGHT_PX, "frame_number": number,
                             "payload_crc32c": crc32c(pixels), **fields})
    return record(2, header + pixels.tobytes())


@contextlib.contextmanager
def fake_daemon(*answers, hold=False):
    """Sends one answer for each record that comes, then closes the connection, or holds it open."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        done = threading.Event()

        def serve():
            # A client that refuses what it gets closes at once, which resets the connection.
            with contextlib.suppress(ConnectionError), listener.accept()[0] as stream:
                for answer in answers:
                    stream.recv(65536)
                    stream.sendall(answer)
                if hold:
                    done.wait(30)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            done.set()
            thread.join()


class Greeting(unittest.TestCase):
    def test_answers_that_are_no_welcome(self):
        status = control(status={"code": 11, "text": "too many clients"})
        for answer, error, text in (
                (status, RefusedError, "refused: too many clients"), (welcome(2), ProtocolError, "protocol version 2"),
                (subscribed(), ProtocolError, "not a welcome"), (record(1, b"\xff"), ProtocolError, "not a welcome"),
                (record(9, b""), ProtocolError, "not a welcome"),
                (record(1, b"", magic=1), ProtocolError, "wrong magic 0x00000001"),
                (record(1, b"", version=2), ProtocolError, "record version 2"),
                (record(2, bytes(400)), ProtocolError, "400 bytes is over its limit"),
                (record(1, b"")[:8] + b"\xff\xff\xff\x7f", ProtocolError, "over its limit"),
                (b"", ClosedError, "connection closed"), (welcome()[:20], ClosedError, "closed within a record")):
            with fake_daemon(answer) as url, self.assertRaisesRegex(error, text):
                FrameClient.connect(url)

    def test_welcome_in_pieces_that_never_ends(self):
        with fake_daemon(welcome()[:20], hold=True) as url, self.assertRaisesRegex(DeadlineError, "no welcome"):
            FrameClient.connect(url, timeout_s=0.1)


class Hostile(unittest.TestCase):
    def test_changed_bytes_raise_nothing_but_errors_of_the_package(self):
        chance = random.Random(8)
        for _ in range(100):
            answers = [bytearray(welcome()), bytearray(subscribed() + frame(1) + frame(2))]
            for _ in range(chance.randint(1, 3)):
                answer = chance.choice(answers)
                answer[chance.randrange(len(answer))] = chance.randrange(256)
            with fake_daemon(*answers) as url, contextlib.suppress(EmitError):
                with FrameClient.connect(url, timeout_s=0.1) as client:
                    client.subscribe(timeout_s=0.1)
                    for _ in range(3):
                        client.receive(0.1)


class Subscribing(unittest.TestCase):
    def test_answers(self):
        status = control(status={"code": 9, "text": "no such channel"})
        for answer, error, text in (
                (status, RefusedError, "subscription refused: no such channel"),
                (subscribed(every_nth=2), ProtocolError, "cannot leave frames out"),
                (subscribed(compression=1), ProtocolError, "grants compression"),
                (subscribed(error_correction={"data_fragments": 4, "parity_fragments": 1}), ProtocolError,
                 "grants error correction"), (b"", ClosedError, "connection closed")):
            with fake_daemon(welcome(), answer) as url, FrameClient.connect(url) as client:
                self.assertRaisesRegex(error, text, client.subscribe)

    def test_a_daemon_without_channel_names(self):
        with fake_daemon(welcome(), subscribed()) as url, FrameClient.connect(url) as client:
            self.assertRaisesRegex(ProtocolError, "it offers 'a' for 'b'", client.subscribe, channel_name="b")

    def test_no_answer(self):
        with fake_daemon(welcome(), hold=True) as url, FrameClient.connect(url) as client:
            self.assertRaisesRegex(DeadlineError, "no answer to the subscription", client.subscribe, timeout_s=0.1)

    def test_a_channel_without_end_is_refused(self):
        huge = control(welcome=control_pb2.Welcome(protocol_version=1, channels=[channel(width_px=1 << 20,
                                                                                          height_px=1 << 20)]))
        with fake_daemon(huge) as url, FrameClient.connect(url) as client:
            self.assertRaisesRegex(ProtocolError, "frames of more than", client.subscribe)


class Frames(unittest.TestCase):
    @contextlib.contextmanager
    def client(self, *frames, hold=False, **options):
        with fake_daemon(welcome(), subscribed() + b"".join(frames), hold=hold) as url:
            with FrameClient.connect(url, **options) as client:
                client.subscribe()
                yield client

    def test_unknown_records_are_skipped_and_statuses_kept(self):
        status = control(status={"code": 12, "text": "a defect"})
        with self.client(record(77, b"new"), status, frame(1), record(1, b"\xff"), frame(2)) as client:
            self.assertEqual([client.receive().header.frame_number for _ in range(2)], [1, 2])
            (kept,) = client.take_statuses()
            self.assertEqual((kept.code, kept.text), (12, "a defect"))
            self.assertEqual(client.take_statuses(), [])
            self.assertRaisesRegex(ClosedError, "connection closed", client.receive)

    def test_wrong_checksum(self):
        with self.client(frame(1, payload_crc32c=1), frame(2)) as client:
            self.assertEqual(client.receive().header.flags, {"corrupt"})
            self.assertEqual(client.receive().header.flags, set())
            self.assertEqual((client.counters.received, client.counters.crc_errors), (2, 1))
        with self.client(frame(1, payload_crc32c=1), check_crc=False) as client:
            self.assertEqual(client.receive().header.flags, set())

    def test_gaps(self):
        with self.client(frame(1), frame(4), frame(9, flag_bits=1 << 9)) as client:
            for _ in range(3):
                client.receive()
            self.assertEqual((client.counters.lost, client.counters.gaps, client.counters.skipped), (2, 1, 4))

    def test_broken_frames(self):
        # 2 x 4 pixels in the header, 8 x 4 behind it.
        for broken, text in ((frame(1, width_px=2), "128 bytes of pixels, its header says 32"),
                             (frame(1, encoding=1, encoded_bytes=128), "encoding shuffled_lz4, which was not asked"),
                             (frame(1, magic=1), "frame header: magic"), (record(2, bytes(8)), "has no frame header"),
                             (frame(1) + b"x" * 12, "wrong magic 0x78787878"),
                             (record(2, bytes(4096)), "4096 bytes is over its limit")):
            with self.client(broken) as client, self.assertRaisesRegex(ProtocolError, text):
                client.receive()
                client.receive()

    def test_a_frame_in_two_pieces_outlives_a_timeout(self):
        whole = frame(1)
        with fake_daemon(welcome(), subscribed() + whole[:50], whole[50:], hold=True) as url:
            with FrameClient.connect(url) as client:
                client.subscribe()
                self.assertIsNone(client.receive(0.05))
                # Any record makes the daemon of this test go on.
                client._connection.send(record(99, b""), 2**62)
                self.assertEqual(client.receive().header.frame_number, 1)

    def test_end_within_a_frame(self):
        with self.client(frame(1)[:-1]) as client:
            self.assertRaisesRegex(ClosedError, "closed within a record", client.receive)


if __name__ == "__main__":
    unittest.main()
