# SPDX-License-Identifier: Apache-2.0
"""The header in front of every frame's pixels (wire format, section 3)."""
from __future__ import annotations

import dataclasses
import functools
import struct

from .crc32c import crc32c
from .errors import ProtocolError

FRAME_HEADER_BYTES = 384
_MAGIC = 0x524D4645
_VERSION = 2
_LAYOUT = struct.Struct("<I4BHHIIffIfIIIQQQQ10qQ3d4dBBHfqqQffIIIIIIBB2xfffqff60xI")
assert _LAYOUT.size == FRAME_HEADER_BYTES

FLAG_NAMES = (
    "late", "repeated", "stale", "degraded", "partial", "hold", "non_finite", "clamped", "extrapolated", "gap_before",
    "canned", "time_unset", "trigger_fault", "corrupt", "lost_before", "motion_fault")
FLAG_BITS = {name: 1 << bit for bit, name in enumerate(FLAG_NAMES)}
# Only a receiver may set these flags. It clears them where a sender set them.
RECEIVER_FLAG_BITS = FLAG_BITS["partial"] | FLAG_BITS["corrupt"] | FLAG_BITS["lost_before"]

_QUANTITIES = {1: "radiance_w_m2_sr", 2: "temperature_k", 3: "drive", 4: "counts", 5: "photon_radiance"}
_CHANNEL_KINDS = {0: "injection", 1: "projector"}
_MOTION_STATES = ("none", "waiting", "parked", "parking", "capturing", "following", "fault")
_MOTION_FAULTS = ("no_feedback", "no_host", "interlock", "limit", "lock", "clock", "controller_clock", "ignored")
_ENCODINGS = {0: "raw", 1: "shuffled_lz4"}
# What was done to the pixels after they were cut out of the sensor's image, by bit of `output_step_bits`.
OUTPUT_STEP_NAMES = ("mirrored_horizontally", "mirrored_vertically", "rotated_90", "rotated_180", "distorted",
                     "shifted", "corrected", "driven", "blurred", "detected", "counted")


@functools.lru_cache(maxsize=256)
def _names_of(bits: int) -> frozenset[str]:
    return frozenset(FLAG_NAMES[bit] if bit < len(FLAG_NAMES) else f"bit_{bit}"
                     for bit in range(32) if bits >> bit & 1)


@dataclasses.dataclass(frozen=True, slots=True)
class FrameHeader:
    """All fields of a frame header. Names and units are those of the wire format.

    Wall instants are ns of TAI (UTC with the flag time_unset); 0 means that the event did not happen.
    """

    quantity: str  # "radiance_w_m2_sr", "temperature_k", "drive", "counts" or "photon_radiance"
    channel_kind: str  # "injection" or "projector"
    channel_index: int
    width_px: int
    height_px: int
    band_lo_um: float
    band_hi_um: float
    flag_bits: int
    estimated_error_k: float  # NaN: not known; infinite: the image is not to be trusted
    nonfinite_px: int
    clamped_px: int
    payload_crc32c: int
    payload_bytes: int
    run_id: int
    frame_number: int
    host_frame_number: int  # newest host frame used; 0: none yet
    sim_time_ns: int
    pose_sim_time_ns: int
    host_received_ns: int
    deadline_ns: int
    render_start_ns: int
    render_end_ns: int
    readback_end_ns: int
    send_start_ns: int
    previous_age_ns: int
    previous_delay_ns: int
    previous_frame_number: int
    position_m: tuple[float, float, float]  # of the sensor, east, north and up
    world_from_body: tuple[float, float, float, float]  # w, x, y, z
    quality_level: int  # 0: full quality
    encoding: str  # "raw", or "shuffled_lz4", which this package does not ask for
    previous_jitter_ns: int
    slot_begin_ns: int
    trigger_number: int
    prediction_error_m: float
    prediction_error_rad: float
    predictions: int  # while it is 0, the prediction errors have no meaning
    window_x_px: int
    window_y_px: int
    sensor_width_px: int  # 0: the daemon does not say
    sensor_height_px: int
    encoded_bytes: int
    motion_state: str  # of the motion simulator; "none": the daemon drives none
    motion_fault_bits: int
    shift_x_px: float  # projector: the shift that remains to bring the image to where the axes are
    shift_y_px: float
    pointing_error_px: float  # projector: of an earlier frame; NaN: not known
    display_ns: int
    output_step_bits: int  # what was done to the pixels; OUTPUT_STEP_NAMES has the names of the bits
    applied_shift_x_px: float  # with the step "shifted": the shift that the daemon has applied to the pixels
    applied_shift_y_px: float
    fov_h_rad: float  # horizontal, of the whole image of the sensor; 0: the source does not know it

    @property
    def output_steps(self) -> frozenset[str]:
        """Names of what was done to the pixels after they were cut out of the sensor's image."""
        return frozenset(name for bit, name in enumerate(OUTPUT_STEP_NAMES) if self.output_step_bits >> bit & 1)

    @property
    def motion_faults(self) -> frozenset[str]:
        """Reasons of the flag motion_fault. A reason that this package does not know is called bit_N."""
        return frozenset(_MOTION_FAULTS[bit] if bit < len(_MOTION_FAULTS) else f"bit_{bit}"
                         for bit in range(8) if self.motion_fault_bits >> bit & 1)

    @property
    def flags(self) -> frozenset[str]:
        """Names of the flags that are set. A flag that this package does not know is called bit_N."""
        return _names_of(self.flag_bits)

    def with_flags(self, bits: int) -> FrameHeader:
        """Returns the header with these flags set too."""
        return self if bits & ~self.flag_bits == 0 else dataclasses.replace(self, flag_bits=self.flag_bits | bits)


def _motion_state(value: int) -> str:
    return _MOTION_STATES[value] if value < len(_MOTION_STATES) else f"state_{value}"


def parse_frame_header(raw: bytes) -> FrameHeader:
    """Decodes and checks the header at the begin of `raw`. Raises ProtocolError, which names what is wrong."""
    if len(raw) < FRAME_HEADER_BYTES:
        raise ProtocolError(f"frame header: {len(raw)} bytes, {FRAME_HEADER_BYTES} needed")
    raw = bytes(raw[:FRAME_HEADER_BYTES])
    fields = _LAYOUT.unpack(raw)
    magic, version, pixel_format, quantity, channel_kind, header_bytes = fields[:6]
    if magic != _MAGIC:
        raise ProtocolError(f"frame header: magic {magic:#010x}, not {_MAGIC:#010x}")
    if version != _VERSION:
        raise ProtocolError(f"frame header: version {version}, this is version {_VERSION}")
    if header_bytes != FRAME_HEADER_BYTES:
        raise ProtocolError(f"frame header: size field {header_bytes}, not {FRAME_HEADER_BYTES}")
    computed = crc32c(raw[:-4])
    if fields[-1] != computed:
        raise ProtocolError(f"frame header: CRC {fields[-1]:#010x}, computed {computed:#010x}")
    if pixel_format != 1:
        raise ProtocolError(f"frame header: unknown pixel format {pixel_format}")
    if quantity not in _QUANTITIES:
        raise ProtocolError(f"frame header: unknown pixel quantity {quantity}")
    position = fields[31:34]
    quaternion = fields[34:38]
    quality_level, encoding, output_steps, applied_x_px = fields[38:42]
    if encoding not in _ENCODINGS:
        raise ProtocolError(f"frame header: unknown pixel encoding {encoding}")
    header = FrameHeader(
        _QUANTITIES[quantity], _CHANNEL_KINDS.get(channel_kind, f"kind_{channel_kind}"), *fields[6:11],
        fields[11] & ~RECEIVER_FLAG_BITS, *fields[12:31], position, quaternion, quality_level, _ENCODINGS[encoding],
        *fields[42:-9], _motion_state(fields[-9]), *fields[-8:-3], output_steps, applied_x_px, *fields[-3:-1])
    if header.payload_bytes != 4 * header.width_px * header.height_px:
        raise ProtocolError(f"frame header: {header.payload_bytes} payload bytes for {header.width_px}x"
                            f"{header.height_px} float32 pixels")
    if (header.sensor_width_px or header.sensor_height_px) and (
            header.window_x_px + header.width_px > header.sensor_width_px or
            header.window_y_px + header.height_px > header.sensor_height_px):
        raise ProtocolError(
            f"frame header: {header.width_px}x{header.height_px} pixels at {header.window_x_px}, {header.window_y_px}"
            f" of a sensor of {header.sensor_width_px}x{header.sensor_height_px}")
    return header
