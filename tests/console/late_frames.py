#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Counts late and missing frames of a stream of 640x512 px at 200 Hz with and without an open console.

Each round runs a daemon with SCHED_FIFO once without a page and once with the console in headless Chromium, in turn.
With --daemon-cpus the threads of the daemon that make and send frames have those cores, and this program with the
browser and the receiver has --browser-cpus, as if the browser ran on another machine. It needs rights for SCHED_FIFO,
Chromium, and the programs of a build: TEST_BIN_DIR names their folder.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import urllib.request

sys.path[:0] = [str(pathlib.Path(__file__).parent), str(pathlib.Path(__file__).parent.parent / "client_python")]
import browser  # noqa: E402
from daemon import BIN_DIR, Daemon  # noqa: E402

RATE_HZ = 200.0
COUNTERS = ("frames_late", "frames_repeated", "slots_without_image", "frames_skipped")
AGENTS = ("conductor", "receiver", "sender", "motion", "render")


def counters(daemon):
    """Sums of the counters over all their labels."""
    text = urllib.request.urlopen(f"http://{daemon.metrics}/metrics").read().decode()
    lines = [line.rsplit(" ", 1) for line in text.splitlines() if line and not line.startswith("#")]
    return {name: sum(float(value) for key, value in lines if name in key and "_bucket" not in key)
            for name in COUNTERS}


def run(with_page, options):
    cpus = ", ".join(f"{agent}={options.daemon_cpus}" for agent in AGENTS) if options.daemon_cpus else ""
    more = ('[console]\nlisten = "127.0.0.1:0"\nrate_hz = 10.0\n[metrics]\nlisten = "127.0.0.1:0"\n'
            f'[realtime]\nscheduler = "fifo"\ncpus = "{cpus}"\n')
    page = None
    with Daemon(640, 512, f'mode = "ig-clock"\nrate_hz = {RATE_HZ}', more=more) as daemon:
        try:
            images = 0
            if with_page:
                page = browser.Browser(1280, 800)
                page.open(daemon.console)
                page.wait_for("emitConsole.image.frame !== null", 60)
                images = page.evaluate("emitConsole.image.frame.sequence")
            before = counters(daemon)
            received = subprocess.run([BIN_DIR / "emit", "receive", daemon.tcp_url, "--frames", str(options.frames),
                                       "--json", "-"], capture_output=True, text=True, check=True)
            after = counters(daemon)
            if with_page:
                images = page.evaluate("emitConsole.image.frame.sequence") - images
        finally:
            if page:
                page.close()
    report = json.loads(received.stdout)
    return {"frames": report["frames"], "gaps": report["unflagged_gaps"], "images": images,
            **{name: int(after[name] - before[name]) for name in COUNTERS}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--frames", type=int, default=4000, help="of each run")
    parser.add_argument("--daemon-cpus", default="", help="cores of the daemon's frames, such as 1 or 2-3")
    parser.add_argument("--browser-cpus", default="", help="cores of browser and receiver, such as 0 or 0,1")
    options = parser.parse_args()
    if options.browser_cpus:
        os.sched_setaffinity(0, {int(cpu) for cpu in options.browser_cpus.split(",")})
    for i in range(options.rounds):
        for with_page in ((False, True) if i % 2 == 0 else (True, False)):
            print("with page   " if with_page else "without page", run(with_page, options), flush=True)


if __name__ == "__main__":
    main()
