# SPDX-License-Identifier: Apache-2.0
"""Host frames as plain objects (wire format, section 5).

Values are not checked here: the daemon refuses what is not valid, and its status names the field and the range.
"""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from .errors import ArgumentError
from .messages import host_pb2
from .server_info import PROTOCOL_VERSION

MAX_HOST_FRAME_BYTES = 65507
MAX_ENTITIES = 128

Vector = Sequence[float]
_LEVEL_NORTH = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)


def _product(a: Vector, b: Vector) -> tuple[float, float, float, float]:
    """Returns the product of two quaternions w, x, y, z."""
    return (a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0])


def attitude(heading_rad: float = 0.0, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> tuple[
        float, float, float, float]:
    """Returns the quaternion world_from_body (w, x, y, z) of a body with x forward, y right and z down.

    Heading counts clockwise from north, pitch is nose up, roll is right side down. They act in this order.
    """
    turn = (math.cos(heading_rad / 2), 0.0, 0.0, math.sin(heading_rad / 2))
    nose = (math.cos(pitch_rad / 2), 0.0, math.sin(pitch_rad / 2), 0.0)
    lean = (math.cos(roll_rad / 2), math.sin(roll_rad / 2), 0.0, 0.0)
    return _product(_product(_product(_LEVEL_NORTH, turn), nose), lean)


@dataclasses.dataclass(frozen=True)
class Pose:
    """Position in local east-north-up metres, and attitude. The default attitude is level and heading north.

    Rates help the daemon to predict. They come both or not at all; without them it takes differences of poses.
    """

    position_m: Vector = (0.0, 0.0, 0.0)
    world_from_body: Vector = _LEVEL_NORTH  # w, x, y, z
    velocity_m_s: Vector | None = None  # in the world frame
    angular_rate_rad_s: Vector | None = None  # in the body frame

    @staticmethod
    def heading(position_m: Vector, heading_rad: float = 0.0, pitch_rad: float = 0.0,
                roll_rad: float = 0.0) -> Pose:
        """Returns a pose by the three angles of attitude()."""
        return Pose(position_m, attitude(heading_rad, pitch_rad, roll_rad))

    @staticmethod
    def looking_at(position_m: Vector, target_m: Vector) -> Pose:
        """Returns a pose whose x axis points at the target, without roll."""
        east, north, up = (to - at for at, to in zip(position_m, target_m, strict=True))
        level = math.hypot(east, north)
        if level == 0 and up == 0:
            raise ArgumentError(f"target_m is {tuple(target_m)}, the position itself: it gives no direction")
        return Pose.heading(position_m, math.atan2(east, north), math.atan2(up, level))

    def to_message(self) -> host_pb2.Pose:
        out = host_pb2.Pose(position_m=_vector("position_m", self.position_m))
        w, x, y, z = _numbers("world_from_body", self.world_from_body, 4)
        out.world_from_body.CopyFrom(host_pb2.Quaternion(w=w, x=x, y=y, z=z))
        if self.velocity_m_s is not None:
            out.velocity_m_s.CopyFrom(_vector("velocity_m_s", self.velocity_m_s))
        if self.angular_rate_rad_s is not None:
            out.angular_rate_rad_s.CopyFrom(_vector("angular_rate_rad_s", self.angular_rate_rad_s))
        return out


@dataclasses.dataclass(frozen=True)
class EntityState:
    """State of one entity of the scenario."""

    entity_id: int
    pose: Pose | None = None  # None: the entity stays where it is
    on: bool = True  # False: the entity is hidden
    teleport: bool = False  # the entity jumps to the pose without motion in between

    def to_message(self) -> host_pb2.EntityState:
        pose = None if self.pose is None else self.pose.to_message()
        return host_pb2.EntityState(entity_id=self.entity_id, pose=pose, off=not self.on, teleport=self.teleport)


@dataclasses.dataclass(frozen=True)
class Environment:
    """Weather from a host frame's simulation time on. The ranges are in the wire format, section 5."""

    direct_normal_w_m2: float
    diffuse_horizontal_w_m2: float
    longwave_down_w_m2: float
    air_k: float
    wind_m_s: float
    cloud_frac: float
    environment_k: float | None = None
    film_w_m2_k: float | None = None
    wind_from_deg: float | None = None  # clockwise from north; None: all directions count alike
    relative_humidity_frac: float | None = None  # over water; None: the scenario's dew point counts
    rain_mm_h: float = 0.0

    def to_message(self) -> host_pb2.Environment:
        return host_pb2.Environment(**{name: value for name, value in dataclasses.asdict(self).items()
                                       if value is not None})


@dataclasses.dataclass(frozen=True)
class HostFrame:
    """One host frame. Frame numbers count up by one in a run; a new run id begins a new run."""

    run_id: int
    frame_number: int
    sim_time_ns: int  # since the scenario's epoch; it never goes back within a run
    seeker: Pose = Pose()
    entities: Sequence[EntityState] = ()
    environment: Environment | None = None  # None: the weather stays as it is
    fov_h_rad: float | None = None  # horizontal field of view from this frame on; None: unchanged
    # Yaw, pitch and roll of the detector against the seeker's body; None: unchanged.
    gimbal_rad: tuple[float, float, float] | None = None

    def encode(self) -> bytes:
        """Returns the bytes of an emit.v1.HostFrame. Raises ArgumentError where the frame cannot be encoded."""
        if len(self.entities) > MAX_ENTITIES:
            raise ArgumentError(f"host frame {self.frame_number}: {len(self.entities)} entities, at most"
                                f" {MAX_ENTITIES} fit")
        try:
            out = host_pb2.HostFrame(
                protocol_version=PROTOCOL_VERSION, frame_number=self.frame_number, sim_time_ns=self.sim_time_ns,
                run_id=self.run_id, seeker=self.seeker.to_message(),
                entities=[entity.to_message() for entity in self.entities],
                environment=None if self.environment is None else self.environment.to_message(),
                fov_h_rad=self.fov_h_rad,
                gimbal=None if self.gimbal_rad is None else host_pb2.Gimbal(
                    yaw_rad=self.gimbal_rad[0], pitch_rad=self.gimbal_rad[1], roll_rad=self.gimbal_rad[2]))
        except (TypeError, ValueError) as error:
            if isinstance(error, ArgumentError):
                raise
            raise ArgumentError(f"host frame {self.frame_number}: {error}") from error
        body = out.SerializeToString()
        if len(body) > MAX_HOST_FRAME_BYTES:
            raise ArgumentError(f"host frame {self.frame_number}: {len(body)} bytes, at most {MAX_HOST_FRAME_BYTES}"
                                " fit")
        return body


def _numbers(name: str, values: Vector, count: int) -> list[float]:
    out = [float(value) for value in values]
    if len(out) != count:
        raise ArgumentError(f"{name} has {len(out)} numbers, must have {count}")
    return out


def _vector(name: str, values: Vector) -> host_pb2.Vector3:
    x, y, z = _numbers(name, values, 3)
    return host_pb2.Vector3(x=x, y=y, z=z)
