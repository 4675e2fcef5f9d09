# SPDX-License-Identifier: Apache-2.0
import random
import time
import unittest

import numpy as np
from emit_client import crc32c
from wire import crc32c_bit_by_bit


class Crc32c(unittest.TestCase):
    def test_examples_of_rfc_3720(self):
        scsi_read = bytes.fromhex("01c0000000000000000000000000000014000000000004000000001400000018"
                                  "28000000000000000200000000000000")
        for data, crc in ((bytes(32), 0x8A9136AA), (b"\xff" * 32, 0x62A8AB43), (bytes(range(32)), 0x46DD794E),
                          (bytes(range(31, -1, -1)), 0x113FDB5C), (scsi_read, 0xD9963A56)):
            self.assertEqual(crc32c(data), crc)
        self.assertEqual(crc32c(b"123456789"), 0xE3069283)
        self.assertEqual(crc32c(b""), 0)

    def test_long_messages_of_every_remainder(self):
        data = random.Random(1).randbytes(70_000)
        # Below and above the number of lanes (8192 words), and with 0 to 3 bytes behind the last word.
        for length in (1023, 1024, 1025, 1026, 1027, 5000, 32_767, 32_768, 32_769, 32_772, 65_536, 65_543, 70_000):
            self.assertEqual(crc32c(data[:length]), crc32c_bit_by_bit(data[:length]), length)

    def test_a_call_continues_another(self):
        data = random.Random(2).randbytes(50_000)
        for cut in (0, 1, 1000, 40_001, 50_000):
            self.assertEqual(crc32c(data[cut:], crc32c(data[:cut])), crc32c(data), cut)

    def test_any_buffer_or_array(self):
        image = np.random.default_rng(3).random((48, 64), np.float32)
        expected = crc32c_bit_by_bit(image.tobytes())
        for buffer in (image, image.tobytes(), bytearray(image.tobytes()), memoryview(image), image.view(np.uint8)):
            self.assertEqual(crc32c(buffer), expected)
        self.assertEqual(crc32c(image[:, ::2]), crc32c(image[:, ::2].tobytes()))

    def test_a_frame_takes_milliseconds(self):
        image = np.random.default_rng(4).random((512, 640), np.float32)
        crc32c(image)
        times_s = []
        for _ in range(9):
            begin_s = time.perf_counter()
            crc32c(image)
            times_s.append(time.perf_counter() - begin_s)
        print(f"crc32c of 640x512 float32: {1e3 * min(times_s):.2f} ms at best, {1e3 * sorted(times_s)[4]:.2f} ms"
              " median")
        # A byte at a time would take some 100 ms. The rest is room for a busy machine.
        self.assertLess(min(times_s), 0.05)


if __name__ == "__main__":
    unittest.main()
