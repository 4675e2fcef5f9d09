# SPDX-License-Identifier: Apache-2.0
import math
import struct
import unittest

import numpy as np
from emit_client import FLAG_NAMES, Channel, ProtocolError, parse_frame_header
from emit_client.messages import control_pb2
from wire import HEADER_DEFAULTS, crc32c_bit_by_bit, frame_header


def with_crc(raw: bytes) -> bytes:
    return raw[:380] + struct.pack("<I", crc32c_bit_by_bit(raw[:380]))


class FrameHeaderBytes(unittest.TestCase):
    def test_every_field_is_at_its_place(self):
        given = dict(channel_kind=1, channel_index=2, width_px=3, height_px=4, band_lo_um=3.5, band_hi_um=4.25,
                     estimated_error_k=0.5, nonfinite_px=5, clamped_px=6, payload_crc32c=7, run_id=2**63 + 8,
                     frame_number=9, host_frame_number=10, sim_time_ns=-11, pose_sim_time_ns=12, host_received_ns=13,
                     deadline_ns=14, render_start_ns=15, render_end_ns=16, readback_end_ns=17, send_start_ns=18,
                     previous_age_ns=-19, previous_delay_ns=20, previous_frame_number=21, quality_level=22,
                     previous_jitter_ns=23, slot_begin_ns=24, trigger_number=25, prediction_error_m=26.5,
                     prediction_error_rad=27.5, predictions=28, window_x_px=29, window_y_px=30, sensor_width_px=131,
                     sensor_height_px=132, motion_fault_bits=0b101001, shift_x_px=33.5, shift_y_px=-34.5,
                     pointing_error_px=0.25, display_ns=35, output_step_bits=0b10100110, applied_shift_x_px=36.5,
                     applied_shift_y_px=-37.5)
        header = parse_frame_header(frame_header(
            **given, motion_state=5, position_east_m=1.5, position_north_m=2.5, position_up_m=3.5, attitude_w=0.5,
            attitude_x=-0.5, attitude_y=0.25, attitude_z=0.75))
        given.update(channel_kind="projector")
        for name, value in given.items():
            self.assertEqual(getattr(header, name), value, name)
        self.assertEqual(header.position_m, (1.5, 2.5, 3.5))
        self.assertEqual(header.world_from_body, (0.5, -0.5, 0.25, 0.75))
        self.assertEqual(header.output_steps, {"mirrored_vertically", "rotated_90", "shifted", "driven"})
        self.assertEqual(header.motion_state, "following")
        self.assertEqual(header.motion_faults, {"no_feedback", "limit", "clock"})
        self.assertEqual(header.quantity, "radiance_w_m2_sr")
        self.assertEqual(header.payload_bytes, 48)
        self.assertEqual(header.encoding, "raw")

    def test_drive_is_a_quantity_of_its_own(self):
        self.assertEqual(parse_frame_header(frame_header(quantity=3)).quantity, "drive")

    def test_offsets_of_the_table(self):
        raw = bytearray(frame_header(width_px=3, height_px=4))
        for offset, layout, name, value in ((56, "<Q", "run_id", 77), (64, "<Q", "frame_number", 78),
                                            (72, "<Q", "host_frame_number", 79), (80, "<q", "sim_time_ns", -80),
                                            (160, "<Q", "previous_frame_number", 81), (224, "B", "quality_level", 3),
                                            (226, "B", "output_step_bits", 5), (228, "<f", "applied_shift_x_px", 1.5),
                                            (240, "<q", "slot_begin_ns", 82), (312, "<f", "applied_shift_y_px", 2.5),
                                            (264, "<I", "predictions", 83)):
            struct.pack_into(layout, raw, offset, value)
            self.assertEqual(getattr(parse_frame_header(with_crc(bytes(raw))), name), value, name)

    def test_flags_have_names(self):
        for bit, name in enumerate(FLAG_NAMES):
            expected = set() if name in ("partial", "corrupt", "lost_before") else {name}
            header = parse_frame_header(frame_header(flag_bits=1 << bit))
            # A sender's flags of a receiver are cleared.
            self.assertEqual(header.flags, expected)
        self.assertEqual(parse_frame_header(frame_header(flag_bits=1 | 1 << 20)).flags, {"late", "bit_20"})
        header = parse_frame_header(frame_header()).with_flags(1 << 13)
        self.assertEqual(header.flags, {"corrupt"})

    def test_not_finite_errors_are_kept(self):
        self.assertTrue(math.isnan(parse_frame_header(frame_header(estimated_error_k=math.nan)).estimated_error_k))
        self.assertEqual(parse_frame_header(frame_header(estimated_error_k=math.inf)).estimated_error_k, math.inf)

    def test_reserved_bytes_are_ignored(self):
        raw = bytearray(frame_header())
        raw[227] = 0xFF
        raw[290:292] = b"\xff" * 2
        self.assertEqual(parse_frame_header(with_crc(bytes(raw))).frame_number, 1)

    def test_faults_are_named(self):
        good = frame_header()
        self.assertNotIn("magic", HEADER_DEFAULTS.keys() - {"magic"})
        for raw, text in ((good[:383], "383 bytes, 384 needed"), (frame_header(magic=1), "magic 0x00000001"),
                          (frame_header(version=1), "version 1, this is version 2"),
                          (frame_header(header_bytes=319), "size field 319"),
                          (good[:100] + b"\x01" + good[101:], "CRC"),
                          (frame_header(pixel_format=2), "unknown pixel format 2"),
                          (frame_header(quantity=6), "unknown pixel quantity 6"),
                          (frame_header(encoding=2), "unknown pixel encoding 2"),
                          (frame_header(payload_bytes=8), "8 payload bytes for 1x1"),
                          (frame_header(sensor_width_px=4, sensor_height_px=4, window_x_px=4), "of a sensor of 4x4")):
            with self.assertRaises(ProtocolError) as raised:
                parse_frame_header(raw)
            self.assertIn(text, str(raised.exception))


class ChannelGeometry(unittest.TestCase):
    def test_a_place_of_a_turned_frame_is_found_in_the_sensors_image(self):
        image = np.arange(12 * 10).reshape(10, 12)
        for bits in range(16):
            # numpy mirrors and rotates the window; its pixels are numbered, so that each one is found again.
            window = image[3:7, 2:7]
            if bits & 1:
                window = np.fliplr(window)
            if bits & 2:
                window = np.flipud(window)
            frame = np.rot90(window, -(bits >> 2))
            channel = Channel.of(control_pb2.ChannelInfo(
                width_px=frame.shape[1], height_px=frame.shape[0], window_x_px=2, window_y_px=3, window_width_px=5,
                window_height_px=4, output_steps=bits))
            for y in range(frame.shape[0]):
                for x in range(frame.shape[1]):
                    column, row = channel.sensor_point(x + 0.5, y + 0.5)
                    self.assertEqual(image[int(row), int(column)], frame[y, x], (bits, x, y))
                    self.assertEqual((column % 1, row % 1), (0.5, 0.5))

    def test_only_the_map_knows_places_of_a_distorted_frame(self):
        self.assertIsNone(Channel.of(control_pb2.ChannelInfo(width_px=5, output_steps=16)).sensor_point(1.0, 1.0))

    def test_an_older_daemon_names_no_size_of_the_window(self):
        channel = Channel.of(control_pb2.ChannelInfo(width_px=5, height_px=4, window_x_px=2, window_y_px=1))
        self.assertEqual(channel.sensor_point(4.5, 0.5), (6.5, 1.5))


if __name__ == "__main__":
    unittest.main()
