# SPDX-License-Identifier: Apache-2.0
"""Bytes as the wire format has them, made here a second time and in the plainest way."""
import struct

HEADER_LAYOUT = "<IBBBBHHIIffIfIIIQQQQqqqqqqqqqqQdddddddBBBBfqqQffIIIIIIBBHfffqff60s"


def crc32c_bit_by_bit(data: bytes) -> int:
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = (register >> 1) ^ (0x82F63B78 if register & 1 else 0)
    return register ^ 0xFFFFFFFF


HEADER_DEFAULTS = dict(
    magic=0x524D4645, version=2, pixel_format=1, quantity=1, channel_kind=0, header_bytes=384, channel_index=0,
    width_px=1, height_px=1, band_lo_um=3.0, band_hi_um=5.0, flag_bits=0, estimated_error_k=0.0, nonfinite_px=0,
    clamped_px=0, payload_crc32c=0, payload_bytes=None, run_id=1, frame_number=1, host_frame_number=0, sim_time_ns=0,
    pose_sim_time_ns=0, host_received_ns=0, deadline_ns=0, render_start_ns=0, render_end_ns=0, readback_end_ns=0,
    send_start_ns=0, previous_age_ns=0, previous_delay_ns=0, previous_frame_number=0, position_east_m=0.0,
    position_north_m=0.0, position_up_m=0.0, attitude_w=1.0, attitude_x=0.0, attitude_y=0.0, attitude_z=0.0,
    quality_level=0, encoding=0, output_step_bits=0, reserved=0, applied_shift_x_px=0.0, previous_jitter_ns=0, slot_begin_ns=0, trigger_number=0, prediction_error_m=0.0,
    prediction_error_rad=0.0, predictions=0, window_x_px=0, window_y_px=0, sensor_width_px=0, sensor_height_px=0,
    encoded_bytes=0, motion_state=0, motion_fault_bits=0, reserved_motion=0, shift_x_px=0.0, shift_y_px=0.0,
    pointing_error_px=0.0, display_ns=0, applied_shift_y_px=0.0,
    fov_h_rad=0.0, reserved_growth=b"")


def frame_header(**fields) -> bytes:
    values = {**HEADER_DEFAULTS, **fields}
    unknown = values.keys() - HEADER_DEFAULTS.keys()
    assert not unknown, unknown
    if values["payload_bytes"] is None:
        values["payload_bytes"] = 4 * values["width_px"] * values["height_px"]
    head = struct.pack(HEADER_LAYOUT, *values.values())
    assert len(head) == 380
    return head + struct.pack("<I", crc32c_bit_by_bit(head))


def byte_stream(header: bytes, pixels: bytes, payload_bytes: int) -> bytes:
    """Returns header, pixels, zero bytes and the header again, as fragments of this payload carry them."""
    body = header + pixels
    rest = payload_bytes - len(body) % payload_bytes
    zeros = rest if rest < len(header) else 0
    return body + bytes(zeros) + header


def fragments(header: bytes, pixels: bytes, *, payload_bytes: int = 1440, stream_id: int = 3, frame_id: int = 1,
              sim_time_ns: int = 0) -> list[bytes]:
    """Returns the datagrams of a frame."""
    stream = byte_stream(header, pixels, payload_bytes)
    out = []
    for offset in range(0, len(stream), payload_bytes):
        payload = stream[offset:offset + payload_bytes]
        flags = (offset == 0) | (offset + len(payload) == len(stream)) << 1
        out.append(struct.pack("<IBBHIIIHHq", 0x474D4645, 1, flags, stream_id, frame_id, offset, len(stream),
                               len(payload), 0, sim_time_ns) + payload)
    return out


def record(kind: int, body: bytes, *, magic: int = 0x43524D45, version: int = 1) -> bytes:
    return struct.pack("<IBBHI", magic, version, kind, 0, len(body)) + body
