# SPDX-License-Identifier: Apache-2.0
import random
import struct
import unittest

import numpy as np
from emit_client import crc32c
from emit_client.frames import FrameAccount
from emit_client.frame_header import FLAG_BITS, parse_frame_header
from emit_client.reassembler import Reassembler
from emit_client.resend_planner import ResendPlanner, encode_resend
from wire import fragments, frame_header

WIDTH_PX, HEIGHT_PX = 60, 36  # 7 fragments of 1440 bytes, the last one with pixels and the second header
STREAM = 3


class Case(unittest.TestCase):
    def setUp(self):
        self.reassembler = self.make()

    def make(self, **options):
        return Reassembler(STREAM, 4 * WIDTH_PX * HEIGHT_PX, **options)

    def image(self, number):
        return np.random.default_rng(number).random((HEIGHT_PX, WIDTH_PX), np.float32)

    def datagrams(self, number, **options):
        pixels = self.image(number)
        header = frame_header(width_px=WIDTH_PX, height_px=HEIGHT_PX, frame_number=number, sim_time_ns=number * 1000,
                              payload_crc32c=crc32c(pixels))
        return fragments(header, pixels.tobytes(), **{"frame_id": number, "sim_time_ns": number * 1000, **options})

    def push(self, datagrams):
        return [self.reassembler.push(datagram) for datagram in datagrams]

    def pop_all(self):
        return list(iter(self.reassembler.pop, None))

    def expect_whole(self, frame, number):
        self.assertEqual(frame.header.frame_number, number)
        self.assertEqual(frame.missing_px, 0)
        self.assertIsNone(frame.validity)
        self.assertTrue(np.array_equal(frame.pixels, self.image(number)))
        self.assertEqual(frame.pixels.dtype, np.float32)


class Whole(Case):
    def test_in_order(self):
        for number in (1, 2, 3):
            self.push(self.datagrams(number))
            (frame,) = self.pop_all()
            self.expect_whole(frame, number)
            self.assertEqual(frame.header.flags, set())

    def test_every_payload_length(self):
        for number, payload_bytes in enumerate((384, 388, 768, 1440, 8900, 9600, 9604, 9920, 9924, 20_000, 65_472), 1):
            self.push(self.datagrams(number, payload_bytes=payload_bytes))
            (frame,) = self.pop_all()
            self.expect_whole(frame, number)

    def test_shuffled_and_doubled(self):
        chance = random.Random(5)
        for number in range(1, 30):
            datagrams = 2 * self.datagrams(number)
            chance.shuffle(datagrams)
            statuses = self.push(datagrams)
            self.assertEqual(statuses.count("accepted"), 7)
            self.assertLessEqual(set(statuses), {"accepted", "duplicate", "late"})
            (frame,) = self.pop_all()
            self.expect_whole(frame, number)

    def test_two_frames_mixed(self):
        first, second = self.datagrams(1), self.datagrams(2)
        self.push(datagram for pair in zip(first, second) for datagram in pair)
        frames = self.pop_all()
        for number, frame in enumerate(frames, 1):
            self.expect_whole(frame, number)
        self.assertEqual(len(frames), 2)

    def test_frame_ids_wrap(self):
        for number, frame_id in enumerate((2**32 - 2, 2**32 - 1, 0, 1), 1):
            self.push(self.datagrams(number, frame_id=frame_id))
            (frame,) = self.pop_all()
            self.expect_whole(frame, number)
            self.assertEqual(frame.frames_lost_before, 0)

    def test_wrong_pixel_is_corrupt(self):
        datagrams = self.datagrams(1)
        datagrams[3] = datagrams[3][:-1] + bytes([datagrams[3][-1] ^ 1])
        self.push(datagrams)
        (frame,) = self.pop_all()
        self.assertEqual(frame.header.flags, {"corrupt"})
        self.reassembler = self.make(check_crc=False)
        self.push(datagrams)
        (frame,) = self.pop_all()
        self.assertEqual(frame.header.flags, set())

    def test_damaged_first_header_is_read_from_the_end(self):
        datagrams = self.datagrams(1)
        datagrams[0] = datagrams[0][:32 + 70] + b"\xff" + datagrams[0][32 + 71:]
        self.push(datagrams)
        (frame,) = self.pop_all()
        self.expect_whole(frame, 1)


class Lost(Case):
    def test_partial_frame_comes_before_the_next(self):
        datagrams = self.datagrams(1)
        del datagrams[3]
        self.push(datagrams)
        self.assertEqual(self.pop_all(), [])
        self.push(self.datagrams(2))
        partial, whole = self.pop_all()
        self.assertEqual(partial.header.flags, {"partial"})
        self.assertEqual(partial.missing_px, 360)
        self.assertEqual(np.count_nonzero(~partial.validity), 360)
        image = self.image(1)
        self.assertTrue(np.array_equal(partial.pixels[partial.validity], image[partial.validity]))
        self.assertFalse(partial.pixels[~partial.validity].any())
        first_missing = (3 * 1440 - 384) // 4
        self.assertFalse(partial.validity.reshape(-1)[first_missing])
        self.assertTrue(partial.validity.reshape(-1)[first_missing - 1])
        self.expect_whole(whole, 2)
        self.assertEqual(whole.header.flags, set())

    def test_either_header_is_enough(self):
        for lost in (0, -1):
            self.reassembler = self.make()
            datagrams = self.datagrams(1)
            del datagrams[lost]
            self.push(datagrams)
            self.reassembler.flush()
            (frame,) = self.pop_all()
            self.assertTrue(frame.header_known)
            self.assertEqual(frame.header.frame_number, 1)
            self.assertIn("partial", frame.header.flags)

    def test_without_both_headers_the_geometry_is_that_of_the_frame_before(self):
        self.push(self.datagrams(1))
        self.push(self.datagrams(2)[1:-1])
        self.reassembler.flush()
        _, frame = self.pop_all()
        self.assertFalse(frame.header_known)
        self.assertEqual((frame.header.width_px, frame.header.height_px), (WIDTH_PX, HEIGHT_PX))
        self.assertEqual(frame.header.sim_time_ns, 2000)
        self.assertEqual(frame.header.frame_number, 0)
        self.assertEqual(frame.header.flags, {"partial"})

    def test_without_any_geometry_it_is_dropped(self):
        self.push(self.datagrams(1)[1:-1])
        self.reassembler.flush()
        self.assertEqual(self.pop_all(), [])
        self.assertEqual(self.reassembler.frames_unusable, 1)

    def test_a_lost_second_header_alone_is_not_partial(self):
        # The second header has a fragment of its own if the payload is 384 bytes.
        datagrams = self.datagrams(1, payload_bytes=384)
        del datagrams[-1]
        self.push(datagrams)
        self.reassembler.flush()
        (frame,) = self.pop_all()
        self.expect_whole(frame, 1)
        self.assertEqual(frame.header.flags, set())

    def test_lost_frames_are_counted_on_the_next(self):
        account = FrameAccount()
        for number in (1, 2, 5):
            self.push(self.datagrams(number))
        for frame in self.pop_all():
            account.take(frame.header, frame.frames_lost_before)
        self.assertEqual(frame.frames_lost_before, 2)
        self.assertEqual(frame.header.flags, {"lost_before"})
        self.assertEqual(account.counters.lost, 2)

    def test_a_third_frame_pushes_the_oldest_out(self):
        for number in (1, 2):
            self.push(self.datagrams(number)[:-1])
        self.assertEqual(self.pop_all(), [])
        self.push(self.datagrams(3)[:1])
        (frame,) = self.pop_all()
        self.assertEqual(frame.header.frame_number, 1)
        self.assertIn("partial", frame.header.flags)


class Refused(Case):
    def test_statuses(self):
        good = self.datagrams(1)[1]

        def changed(offset, layout, value):
            out = bytearray(good)
            struct.pack_into(layout, out, offset, value)
            return bytes(out)

        for datagram, status in ((good[:31], "short_input"), (b"", "short_input"), (changed(0, "<I", 1), "wrong_magic"),
                                 (changed(4, "B", 2), "wrong_version"), (changed(6, "<H", 4), "foreign"),
                                 (good[:-4], "short_input"), (good + bytes(4), "bad_length"),
                                 (changed(20, "<H", 0), "bad_length"), (changed(12, "<I", 1442), "bad_offset"),
                                 (changed(12, "<I", 10_000_000), "bad_offset"), (changed(16, "<I", 768), "oversize"),
                                 (changed(16, "<I", 4 * WIDTH_PX * HEIGHT_PX + 1152), "oversize"),
                                 (changed(5, "B", 1), "inconsistent"), (changed(5, "B", 2), "inconsistent")):
            self.assertEqual(self.reassembler.push(datagram), status)
        self.assertEqual(self.reassembler.push(good), "accepted")
        self.assertEqual(self.reassembler.push(good), "duplicate")
        self.assertEqual(self.reassembler.push(changed(12, "<I", 1440 + 4)), "overlap")
        self.assertEqual(self.reassembler.push(changed(24, "<q", 5)), "inconsistent")
        self.assertEqual(self.reassembler.fragments["accepted"], 1)

    def test_late_fragments_and_a_new_start(self):
        self.push(self.datagrams(1000))
        self.pop_all()
        self.assertEqual(set(self.push(self.datagrams(999))), {"late"})
        # Frame ids from far behind mean a new start only after 16 fragments in a row.
        statuses = []
        for number in range(1, 5):
            statuses += self.push(self.datagrams(number))
        self.assertEqual(statuses[:15], ["late"] * 15)
        self.assertEqual(statuses[15], "accepted")
        self.assertEqual(self.reassembler.resyncs, 1)
        self.assertEqual([frame.header.frame_number for frame in self.pop_all()][-1], 4)


class Hostile(Case):
    def test_changed_datagrams_never_raise(self):
        chance = random.Random(7)
        good = [datagram for number in range(1, 4) for datagram in self.datagrams(number)]
        for _ in range(5000):
            datagram = bytearray(chance.choice(good))
            for _ in range(chance.randint(0, 3)):
                datagram[chance.randrange(min(len(datagram), 32 + 384))] = chance.choice((0, 1, 2, 127, 255))
            if chance.random() < 0.1:
                del datagram[chance.randrange(len(datagram)):]
            if chance.random() < 0.5:
                self.reassembler.push(datagram)
            else:
                self.reassembler.push_joined(np.frombuffer(bytes(datagram) * chance.randint(1, 3), np.uint8),
                                             max(len(datagram), 1))
            for frame in self.pop_all():
                self.assertEqual(frame.pixels.shape, (frame.header.height_px, frame.header.width_px))
        self.reassembler.flush()


class Joined(Case):
    """The kernel joins datagrams; the outcome is that of single ones."""

    def push_joined(self, datagrams):
        self.reassembler.push_joined(np.frombuffer(b"".join(datagrams), np.uint8), len(datagrams[0]))

    def test_whole_frames(self):
        for number in (1, 2):
            datagrams = self.datagrams(number)
            self.push_joined(datagrams[:4])
            self.push_joined(datagrams[4:])
            (frame,) = self.pop_all()
            self.expect_whole(frame, number)
        self.assertEqual(self.reassembler.fragments["accepted"], 14)

    def test_holes_within(self):
        datagrams = self.datagrams(1)
        hole = datagrams.pop(2)
        self.push_joined(datagrams)
        self.assertEqual(self.pop_all(), [])
        self.push([hole])
        (frame,) = self.pop_all()
        self.expect_whole(frame, 1)

    def test_random_cuts_and_losses_agree_with_single_datagrams(self):
        chance = random.Random(6)
        single = self.make()
        frames, expected = [], []
        for number in range(1, 60):
            datagrams = [each for each in self.datagrams(number) if chance.random() > 0.05]
            if chance.random() < 0.2:
                chance.shuffle(datagrams)
            begin = 0
            while begin < len(datagrams):
                end = min(begin + chance.randint(1, 5), len(datagrams))
                # Only the last one may be shorter, as in the kernel.
                while any(len(each) != len(datagrams[begin]) for each in datagrams[begin:end - 1]):
                    end -= 1
                if end - begin > 1 and len(datagrams[end - 1]) > len(datagrams[begin]):
                    end -= 1
                self.push_joined(datagrams[begin:end])
                begin = end
            for datagram in datagrams:
                single.push(datagram)
            frames += self.pop_all()
            expected += iter(single.pop, None)
        self.assertEqual(len(frames), len(expected))
        for frame, other in zip(frames, expected):
            self.assertEqual(frame.header, other.header)
            self.assertTrue(np.array_equal(frame.pixels, other.pixels))
        self.assertEqual(self.reassembler.fragments, single.fragments)

    def test_foreign_and_short_datagrams_among_them(self):
        mine, other = self.datagrams(1), self.datagrams(1, stream_id=4)
        self.push_joined([mine[0], other[0], mine[1], mine[2]])
        self.assertEqual(self.reassembler.fragments["foreign"], 1)
        self.assertEqual(self.reassembler.fragments["accepted"], 3)
        self.reassembler.push_joined(np.zeros(0, np.uint8), 0)
        self.assertEqual(self.reassembler.fragments["short_input"], 1)


class Resend(Case):
    def setUp(self):
        self.reassembler = self.make(max_open=4, wait_for_missing=True)

    def test_newer_frames_wait_for_a_request(self):
        datagrams = self.datagrams(1)
        self.push(datagrams[:2] + datagrams[4:])
        self.push(self.datagrams(2))
        self.assertEqual(self.pop_all(), [])
        (state,) = self.reassembler.open_frames()
        self.assertEqual((state.frame_id, state.end_seen), (1, True))
        self.assertEqual(self.reassembler.missing(1, True, 128), [(2 * 1440, 2 * 1440)])
        again = bytearray(datagrams[2])
        again[5] |= 8
        self.push([again])
        self.assertEqual(self.reassembler.missing(1, True, 128), [(3 * 1440, 1440)])
        self.push(datagrams[3:4])
        first, second = self.pop_all()
        self.expect_whole(first, 1)
        self.assertEqual(first.resent_fragments, 1)
        self.expect_whole(second, 2)

    def test_given_up(self):
        self.push(self.datagrams(1)[:-2])
        self.push(self.datagrams(2))
        self.reassembler.give_up(1)
        first, second = self.pop_all()
        self.assertIn("partial", first.header.flags)
        self.expect_whole(second, 2)

    def test_the_tail_may_still_come(self):
        datagrams = self.datagrams(1)
        self.push([datagrams[0], datagrams[2]])
        self.assertEqual(self.reassembler.missing(1, False, 128), [(1440, 1440)])
        self.assertEqual(len(self.reassembler.missing(1, True, 128)), 2)

    def test_planner_waits_asks_four_times_and_gives_up(self):
        self.push(self.datagrams(1)[:3])
        planner = ResendPlanner()
        now_ns, kinds = 1_000_000_000, []
        for _ in range(40):
            step = planner.next(self.reassembler.open_frames(), now_ns)
            kinds.append(step.kind)
            if step.kind == "give_up":
                break
            now_ns = step.wake_ns or now_ns
        self.assertEqual(kinds.count("ask"), 4)
        self.assertEqual(kinds[-1], "give_up")
        self.assertGreaterEqual(now_ns, 1_000_000_000 + 3_000_000 + 4 * 20_000_000)

    def test_request_bytes(self):
        self.assertEqual(encode_resend(3, 7, [(1440, 2880), (8, 4)]).hex(),
                         "0300" "0200" "07000000" "a0050000" "400b0000" "08000000" "04000000")


class Account(unittest.TestCase):
    def header(self, number, run_id=1, flags=0):
        return parse_frame_header(frame_header(frame_number=number, run_id=run_id, flag_bits=flags))

    def test_gaps_are_announced_or_lost(self):
        account = FrameAccount()
        gap = FLAG_BITS["gap_before"]
        for number, flags in ((5, 0), (6, 1), (8, 0), (12, gap), (13, 2)):
            account.take(self.header(number, flags=flags))
        counters = account.counters
        self.assertEqual((counters.lost, counters.gaps, counters.skipped), (1, 1, 3))
        self.assertEqual((counters.late, counters.repeated), (1, 1))
        account.take(self.header(1, run_id=2))
        self.assertEqual(counters.lost, 1)

    def test_every_nth(self):
        account = FrameAccount()
        account.every_nth = 4
        for number in (1, 5, 9, 17):
            account.take(self.header(number))
        self.assertEqual(account.counters.lost, 1)


if __name__ == "__main__":
    unittest.main()
