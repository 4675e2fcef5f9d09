# SPDX-License-Identifier: Apache-2.0
"""Every metric of the dashboard for Grafana is in the answer of a running emitd, and a wrong name is found."""
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "deploy/scripts"))

import dashboard  # noqa: E402: the path is known only now

# Motion and PTP have metrics of their own. Nobody answers at either.
CONFIG = """
[source]
kind = "canned"
canned_width_px = 32
canned_height_px = 16
canned_frames = 4
[pacing]
mode = "ig-clock"
rate_hz = 20.0
[host]
udp = "127.0.0.1:0"
[control]
tcp = "127.0.0.1:0"
[metrics]
listen = "127.0.0.1:0"
[clock]
ptp_socket = "SOCKET"
[motion]
controller = "127.0.0.1:9"
unit_rings = "yaw-pitch-roll"
axes = [
  { min_deg = -110, max_deg = 110, rate_deg_s = 400, acceleration_deg_s2 = 8000 },
  { min_deg = -110, max_deg = 110, rate_deg_s = 400, acceleration_deg_s2 = 8000 },
  { min_deg = -110, max_deg = 110, rate_deg_s = 400, acceleration_deg_s2 = 8000 },
]
"""


class Dashboard(unittest.TestCase):
    def test_a_running_emitd_has_every_metric(self):
        with tempfile.TemporaryDirectory() as folder:
            config = pathlib.Path(folder) / "daemon.toml"
            config.write_text(CONFIG.replace("SOCKET", f"{folder}/ptp4l"), encoding="utf-8")
            process = subprocess.Popen([pathlib.Path(os.environ["TEST_BIN_DIR"]) / "emitd", "--config", config],
                                       stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            try:
                ready = process.stdout.readline()
                address = dict(word.split("=", 1) for word in ready.split()[1:])["metrics"]
                # ptp4l is asked once a second.
                for _ in range(50):
                    answer = urllib.request.urlopen(f"http://{address.removeprefix('http://')}/metrics", timeout=10)
                    text = answer.read().decode()
                    if "\nemitd_ptp_up " in text:
                        break
                    time.sleep(0.2)
            finally:
                process.terminate()
                process.wait(30)
                process.stdout.close()
        self.assertIn("\nemitd_ptp_up ", text)
        self.assertIn("\nemitd_motion_late_seconds_count ", text)
        made = dashboard.TARGET.read_text(encoding="utf-8")
        self.assertEqual(list(dashboard.faults(made, text)), [])
        wrong = made.replace("emitd_frames_late_total", "emitd_frames_tardy_total")
        self.assertTrue(any("emitd has no metric emitd_frames_tardy_total" in fault
                            for fault in dashboard.faults(wrong, text)))
        without = text.replace("emitd_frames_late_total", "emitd_frames_other_total")
        self.assertTrue(any("lacks emitd_frames_late_total" in fault for fault in dashboard.faults(made, without)))


if __name__ == "__main__":
    unittest.main()
