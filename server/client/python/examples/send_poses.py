#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Sends the poses of a sensor that flies a circle around the origin and looks at it."""
import argparse
import math
import pathlib
import sys
import time

# An installed or built package lies beside the folder of this program.
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from emit_client import EmitError, HostClient, Pose  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url", help="udp://HOST:PORT of the host port, or tcp://HOST:PORT of the control port")
    parser.add_argument("--poses", type=int, default=1000, metavar="N", help="number of poses; default: %(default)s")
    parser.add_argument("--rate-hz", type=float, default=200.0, help="poses per second; default: %(default)s")
    parser.add_argument("--radius-m", type=float, default=500.0, help="of the circle; default: %(default)s")
    parser.add_argument("--height-m", type=float, default=200.0, help="above the origin; default: %(default)s")
    parser.add_argument("--turn-s", type=float, default=60.0, help="time of one turn; default: %(default)s")
    arguments = parser.parse_args()
    if arguments.rate_hz <= 0 or arguments.turn_s <= 0:
        parser.error("--rate-hz and --turn-s must be above 0")
    try:
        with HostClient.connect(arguments.url) as host:
            refused = send(host, arguments)
    except EmitError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    print(f"{arguments.poses} poses sent, {refused} refused")
    return 0 if refused == 0 else 1


def send(host: HostClient, arguments: argparse.Namespace) -> int:
    refused = 0
    begin_s = time.monotonic()
    for number in range(1, arguments.poses + 1):
        sim_time_s = number / arguments.rate_hz
        angle_rad = 2 * math.pi * sim_time_s / arguments.turn_s
        position_m = (arguments.radius_m * math.sin(angle_rad), arguments.radius_m * math.cos(angle_rad),
                      arguments.height_m)
        host.send_pose(round(sim_time_s * 1e9), Pose.looking_at(position_m, (0.0, 0.0, 0.0)))
        # The daemon answers only what it refuses, so the time to wait for answers is the time until the next pose.
        while True:
            status = host.receive_status(max(begin_s + sim_time_s - time.monotonic(), 0.0))
            if status is None:
                break
            refused += not status.ok
            print(f"host frame {status.host_frame_number}: {status.text}", file=sys.stderr)
    return refused


if __name__ == "__main__":
    sys.exit(main())
