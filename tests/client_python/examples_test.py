# SPDX-License-Identifier: Apache-2.0
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
from daemon import Daemon, example_file, run_example


class Examples(unittest.TestCase):
    def test_help(self):
        for name in ("receive_frames.py", "send_poses.py"):
            result = run_example(name, "--help")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("usage: ", result.stdout)

    def test_poses_make_frames_that_are_received_and_saved(self):
        count = 5
        with Daemon() as daemon, tempfile.TemporaryDirectory() as out:
            for host_url, url in ((daemon.tcp_url, daemon.tcp_url), (daemon.host_url, daemon.shm_url)):
                receiver = subprocess.Popen(
                    [sys.executable, "-B", example_file("receive_frames.py"), url, "--frames", str(count),
                     "--out", out],
                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                try:
                    self.assertIn("64 x 48 pixels", receiver.stdout.readline())
                    sender = run_example("send_poses.py", host_url, "--poses", count, "--rate-hz", 100)
                    self.assertEqual(sender.returncode, 0, sender.stderr)
                    self.assertEqual(sender.stdout, f"{count} poses sent, 0 refused\n")
                    said, errors = receiver.communicate(timeout=60)
                finally:
                    receiver.kill()
                    receiver.wait()
                self.assertEqual(receiver.returncode, 0, said + errors)
                self.assertIn(f"frame {count}: host frame {count}, ", said)
                self.assertIn(f"{count} complete, 0 partial, 0 lost, 0 skipped, 0 with a wrong checksum", said)
                files = sorted(Path(out).glob("*.npy"))
                self.assertEqual(len(files), count)
                self.assertEqual((np.load(files[0]).shape, np.load(files[0]).dtype), ((48, 64), np.float32))

    def test_no_daemon(self):
        for name, url in (("receive_frames.py", "shm://no-such-name"), ("send_poses.py", "tcp://127.0.0.1:1"),
                          ("send_poses.py", "nonsense")):
            result = run_example(name, url)
            self.assertEqual(result.returncode, 1)
            self.assertEqual(result.stdout, "")
            self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)


if __name__ == "__main__":
    unittest.main()
