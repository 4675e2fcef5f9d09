# SPDX-License-Identifier: Apache-2.0
import hashlib
import math
import os
import tempfile
import unittest

import numpy as np
from emit_client import ArgumentError, EntityState, Environment, HostFrame, Pose, Security, attitude
from emit_client.messages import host_pb2
from emit_client.security import read_first_key
from emit_client.session_host import derive, is_genuine, seal


def rotated(quaternion, vector):
    """Returns a vector of the body in the world frame."""
    w, *axis = quaternion
    axis, vector = np.array(axis), np.array(vector, float)
    return vector + 2 * w * np.cross(axis, vector) + 2 * np.cross(axis, np.cross(axis, vector))


class Attitude(unittest.TestCase):
    def test_axes_of_the_body_in_east_north_up(self):
        forward, right, down = (1, 0, 0), (0, 1, 0), (0, 0, 1)
        for angles, axis, expected in (
                ((0, 0, 0), forward, (0, 1, 0)), ((0, 0, 0), right, (1, 0, 0)), ((0, 0, 0), down, (0, 0, -1)),
                ((math.pi / 2, 0, 0), forward, (1, 0, 0)), ((math.pi / 2, 0, 0), right, (0, -1, 0)),
                ((0, math.pi / 2, 0), forward, (0, 0, 1)), ((0, 0, math.pi / 2), right, (0, 0, -1)),
                ((math.pi / 2, math.pi / 6, 0), forward, (math.sqrt(0.75), 0, 0.5))):
            self.assertTrue(np.allclose(rotated(attitude(*angles), axis), expected), (angles, axis))
        self.assertTrue(np.allclose(attitude(), Pose().world_from_body))
        self.assertAlmostEqual(math.hypot(*attitude(0.3, -0.4, 2.0)), 1.0)

    def test_looking_at(self):
        pose = Pose.looking_at((10.0, 20.0, 30.0), (13.0, 16.0, 18.0))
        self.assertTrue(np.allclose(rotated(pose.world_from_body, (1, 0, 0)), np.array((3, -4, -12)) / 13))
        # There is no roll: the right side is level.
        self.assertAlmostEqual(rotated(pose.world_from_body, (0, 1, 0))[2], 0.0)
        self.assertRaisesRegex(ArgumentError, "gives no direction", Pose.looking_at, (1, 2, 3), (1, 2, 3))


class Encoding(unittest.TestCase):
    def test_every_field_reaches_the_message(self):
        seeker = Pose((1, 2, 3), (1, 0, 0, 0), (4, 5, 6), (7, 8, 9))
        frame = HostFrame(11, 12, -13, seeker, [EntityState(1, Pose((4, 5, 6)), on=False, teleport=True),
                                                EntityState(2)], Environment(1, 2, 3, 280, 4, 0.5, film_w_m2_k=6))
        message = host_pb2.HostFrame.FromString(frame.encode())
        self.assertEqual((message.protocol_version, message.run_id, message.frame_number, message.sim_time_ns),
                         (1, 11, 12, -13))
        self.assertEqual((message.seeker.position_m.z, message.seeker.world_from_body.w), (3, 1))
        self.assertEqual((message.seeker.velocity_m_s.y, message.seeker.angular_rate_rad_s.x), (5, 7))
        first, second = message.entities
        self.assertEqual((first.entity_id, first.pose.position_m.x, first.off, first.teleport), (1, 4, True, True))
        self.assertFalse(first.pose.HasField("velocity_m_s"))
        self.assertFalse(second.HasField("pose") or second.off or second.teleport)
        self.assertEqual((message.environment.air_k, message.environment.film_w_m2_k), (280, 6))
        self.assertFalse(message.environment.HasField("environment_k"))
        looking = host_pb2.HostFrame.FromString(HostFrame(1, 2, 3, fov_h_rad=0.25, gimbal_rad=(0.1, -0.2, 0.3)).encode())
        self.assertEqual(looking.fov_h_rad, 0.25)
        self.assertEqual((looking.gimbal.yaw_rad, looking.gimbal.pitch_rad, looking.gimbal.roll_rad), (0.1, -0.2, 0.3))
        for field in ("fov_h_rad", "gimbal"):
            self.assertFalse(host_pb2.HostFrame.FromString(HostFrame(1, 2, 3).encode()).HasField(field))
        self.assertFalse(host_pb2.HostFrame.FromString(HostFrame(1, 2, 3).encode()).HasField("environment"))

    def test_a_pose_at_the_origin_is_present(self):
        message = host_pb2.HostFrame.FromString(HostFrame(1, 2, 3).encode())
        self.assertTrue(message.seeker.HasField("position_m"))

    def test_faults_are_named(self):
        for frame, text in (
                (HostFrame(1, 2, 3, entities=[EntityState(i) for i in range(129)]), "129 entities, at most 128 fit"),
                (HostFrame(1, 2, 3, Pose((1, 2))), "position_m has 2 numbers, must have 3"),
                (HostFrame(1, 2, 3, Pose(world_from_body=(1, 0, 0))), "world_from_body has 3 numbers, must have 4"),
                (HostFrame(-1, 2, 3), "host frame 2"), (HostFrame(1, 2, 2**70), "host frame 2"),
                (HostFrame(1, 2, 3, entities=[EntityState(-1)]), "host frame 2")):
            self.assertRaisesRegex(ArgumentError, text, frame.encode)


class Keys(unittest.TestCase):
    def test_datagram_with_a_mac(self):
        key = bytes(range(32))
        datagram = seal(key, 3, 1, 2, 3, b"payload")
        self.assertEqual(len(datagram), 32 + 7 + 16)
        self.assertEqual(datagram[:8].hex(), "454d485301030000")
        self.assertTrue(is_genuine(key, datagram))
        self.assertFalse(is_genuine(key[::-1], datagram))
        self.assertFalse(is_genuine(key, datagram[:-1] + bytes([datagram[-1] ^ 1])))
        expected = hashlib.blake2b(b"emitd host open\0", key=key, digest_size=32).digest()
        self.assertEqual(derive(key, "emitd host open"), expected)

    def test_key_file(self):
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "keys")

            def write(text, mode=0o600):
                with open(file, "w", encoding="utf-8") as out:
                    out.write(text)
                os.chmod(file, mode)

            write(f"# first\n\n{'0a' * 32}\n{'0b' * 32}\n")
            self.assertEqual(read_first_key(file), b"\x0a" * 32)
            for text, mode, error in (("", 0o600, "no key in it"), ("abc", 0o600, "line 1: a key has 64"),
                                      ("xy" * 32, 0o600, "line 1: a key has 64"), ("0a" * 32, 0o640, "chmod 600")):
                write(text, mode)
                self.assertRaisesRegex(ArgumentError, error, read_first_key, file)
        self.assertRaisesRegex(ArgumentError, "No such file", read_first_key, file)
        self.assertRaisesRegex(ArgumentError, "No such file", Security(tls_key=file, tls_certificate="x").context)


if __name__ == "__main__":
    unittest.main()
