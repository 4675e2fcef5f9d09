# SPDX-License-Identifier: Apache-2.0
import shutil
import socket
import subprocess
import time
import unittest

from daemon import Daemon
from emit_client import (ArgumentError, Command, ConnectError, DeadlineError, EmitError, EntityState, Environment,
                         FrameClient, HostClient, HostFrame, Pose, Security, StatusCode)

STEP_NS = 5_000_000


class Hosts(unittest.TestCase):
    def test_every_pose_makes_the_frame_that_answers_it(self):
        with Daemon() as daemon:
            for url in (daemon.tcp_url, daemon.host_url):
                with self.subTest(host=url), FrameClient.connect(daemon.tcp_url) as client:
                    client.subscribe()
                    with HostClient.connect(url) as host:
                        self.assertEqual(host.server is None, url == daemon.host_url)
                        for number in range(1, 5):
                            pose = Pose((number, 2 * number, 3 * number))
                            self.assertEqual(host.send_pose(number * STEP_NS, pose), number)
                            header = client.receive().header
                            self.assertEqual(header.host_frame_number, number)
                            self.assertEqual(header.frame_number, number)
                            self.assertEqual(header.pose_sim_time_ns, number * STEP_NS)
                            self.assertEqual(header.position_m, pose.position_m)
                            self.assertGreater(header.host_received_ns, 0)
                        self.assertIsNone(host.receive_status(0))

    def test_refusals_are_answered(self):
        wrong = HostFrame(1, 1, 0, Pose(world_from_body=(2.0, 0.0, 0.0, 0.0)))
        with Daemon() as daemon:
            for url in (daemon.tcp_url, daemon.host_url):
                with self.subTest(host=url), HostClient.connect(url) as host:
                    host.send(wrong)
                    status = host.receive_status()
                    self.assertEqual(status.code, StatusCode.INVALID_POSE)
                    self.assertFalse(status.ok)
                    self.assertIn("seeker", status.text)
                    self.assertEqual(status.host_frame_number, 1)
                    host.send_pose(STEP_NS, Pose())
                    host.send_pose(0, Pose())
                    self.assertEqual(host.receive_status().code, StatusCode.TIME_BACKWARDS)
                    host.send_pose(2 * STEP_NS, Pose(), environment=Environment(0, 0, 0, 5, 0, 0))
                    status = host.receive_status()
                    self.assertEqual(status.code, StatusCode.INVALID_ENVIRONMENT)
                    self.assertIn("air_k", status.text)
                    host.send_pose(2 * STEP_NS, Pose(), [EntityState(7, Pose()), EntityState(7, Pose())])
                    self.assertEqual(host.receive_status().code, StatusCode.MALFORMED)

    def test_commands(self):
        with Daemon() as daemon, FrameClient.connect(daemon.tcp_url) as client, HostClient.connect(
                daemon.tcp_url) as host:
            client.subscribe()
            sim_time_ns = 0

            def answered(command):
                host.command(command)
                status = host.receive_status()
                self.assertTrue(status.ok or command is Command.STEP, status)
                return status

            def next_frame():
                nonlocal sim_time_ns
                sim_time_ns += STEP_NS
                host.send_pose(sim_time_ns, Pose())
                return client.receive().header

            self.assertEqual(answered(Command.STEP).code, StatusCode.NOT_ALLOWED)
            self.assertNotIn("hold", next_frame().flags)
            answered(Command.HOLD)
            self.assertIn("hold", next_frame().flags)
            answered(Command.START)
            first = next_frame()
            self.assertNotIn("hold", first.flags)
            answered(Command.STOP)
            sim_time_ns += STEP_NS
            number = host.send_pose(sim_time_ns, Pose())
            status = host.receive_status()
            self.assertEqual((status.code, status.host_frame_number), (StatusCode.OK, number))
            self.assertIsNone(client.receive(0.05))
            answered(Command.STEP)
            self.assertEqual(client.receive().header.host_frame_number, number)
            answered(Command.RESET)
            host.run_id += 1
            header = next_frame()
            self.assertEqual(header.frame_number, 1)
            self.assertNotEqual(header.run_id, first.run_id)

    def test_commands_need_tcp(self):
        with Daemon() as daemon, HostClient.connect(daemon.host_url) as host:
            self.assertRaisesRegex(ArgumentError, "commands need a tcp:// connection", host.command, Command.START)

    def test_datagrams_to_a_port_where_nobody_listens(self):
        with socket.socket(type=socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            port = taken.getsockname()[1]
        with HostClient.connect(f"udp://127.0.0.1:{port}") as host:
            with self.assertRaisesRegex(ConnectError, f"127.0.0.1:{port}: nobody listens"):
                for number in range(1, 100):
                    host.send_pose(number, Pose())
                    host.receive_status(0.01)

    def test_end_of_the_daemon(self):
        with Daemon() as daemon, HostClient.connect(daemon.tcp_url) as host:
            host.send_pose(STEP_NS, Pose())
            self.assertEqual(daemon.stop(), 0)
            with self.assertRaisesRegex(EmitError, daemon.control):
                host.receive_status()


class Keys(unittest.TestCase):
    def write_key(self, folder, name, digits):
        file = folder / name
        file.touch(0o600)
        file.write_text(64 * digits + "\n")
        return str(file)

    def test_datagrams_with_a_shared_key(self):
        with Daemon() as plain:
            right = self.write_key(plain.folder, "right", "a")
            wrong = self.write_key(plain.folder, "wrong", "b")
            with Daemon(host_more=f'key_file = "{right}"') as daemon:
                with FrameClient.connect(daemon.tcp_url) as client:
                    client.subscribe()
                    with HostClient.connect(daemon.host_url, security=Security(key_file=right)) as host:
                        for number in range(1, 4):
                            host.send_pose(number * STEP_NS, Pose())
                            self.assertEqual(client.receive().header.host_frame_number, number)
                        host.send_pose(0, Pose())
                        self.assertEqual(host.receive_status().code, StatusCode.TIME_BACKWARDS)
                    with HostClient.connect(daemon.host_url) as host:
                        host.send_pose(STEP_NS, Pose())
                    self.assertIsNone(client.receive(0.05))
                with self.assertRaisesRegex(DeadlineError, "no answer to the key"):
                    HostClient.connect(daemon.host_url, timeout_s=0.3, security=Security(key_file=wrong))


@unittest.skipIf(shutil.which("openssl") is None, "the program openssl makes the certificates")
class Tls(unittest.TestCase):
    def make(self, folder, name, *more):
        command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes",
                   "-days", "2", "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.pem", *more]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        (folder / f"{name}.key").chmod(0o600)

    def test_frames_and_poses(self):
        with Daemon() as plain:
            folder = plain.folder
            self.make(folder, "authority")
            for name, alternative in (("daemon", "IP:127.0.0.1"), ("client", "DNS:client")):
                self.make(folder, name, "-CA", "authority.pem", "-CAkey", "authority.key", "-addext",
                          f"subjectAltName={alternative}", "-addext", "basicConstraints=critical,CA:FALSE")
            tls = (f'[tls]\ncertificate = "{folder}/daemon.pem"\nkey = "{folder}/daemon.key"\n'
                   f'client_ca = "{folder}/authority.pem"\n')
            security = Security(tls_ca=f"{folder}/authority.pem", tls_certificate=f"{folder}/client.pem",
                                tls_key=f"{folder}/client.key")
            with Daemon(320, 256, more=tls) as daemon:
                for url in (daemon.tcp_url, daemon.udp_url):
                    with FrameClient.connect(url, security=security) as client, HostClient.connect(
                            daemon.tcp_url, security=security) as host:
                        client.subscribe()
                        self.assertIsNone(client.receive(0.05))
                        for number in range(1, 4):
                            host.send_pose(number * STEP_NS, Pose())
                            self.assertEqual(client.receive().header.host_frame_number, number)
                        self.assertEqual(client.counters.crc_errors, 0)
                with self.assertRaises(EmitError):
                    FrameClient.connect(daemon.tcp_url)
                strange = Security(tls_ca=f"{folder}/client.pem", tls_certificate=f"{folder}/client.pem",
                                   tls_key=f"{folder}/client.key")
                with self.assertRaisesRegex(ConnectError, "TLS"):
                    FrameClient.connect(daemon.tcp_url, security=strange)
                with self.assertRaisesRegex(ArgumentError, "host datagrams with TLS need key_file"):
                    HostClient.connect(daemon.host_url, security=security)


if __name__ == "__main__":
    unittest.main()
