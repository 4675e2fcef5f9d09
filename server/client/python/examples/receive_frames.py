#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Receives radiance frames, prints one line for each, and saves them as .npy files on request."""
import argparse
import pathlib
import sys

# An installed or built package lies beside the folder of this program.
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import numpy as np  # noqa: E402
from emit_client import ClosedError, EmitError, FrameClient  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url", help="tcp://HOST:PORT or udp://HOST:PORT of the control port, or shm://NAME")
    parser.add_argument("--frames", type=int, metavar="N", help="stop after so many frames; default: never")
    parser.add_argument("--channel", default="", help="name of the channel; default: the first one")
    parser.add_argument("--timeout-s", type=float, default=10.0, help="give up when no frame comes for so long")
    parser.add_argument("--out", type=pathlib.Path, metavar="DIR", help="folder for frame_NNNNNN.npy")
    parser.add_argument("--no-crc", action="store_true", help="do not check the checksum of the pixels")
    arguments = parser.parse_args()
    if arguments.out is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
    try:
        with FrameClient.connect(arguments.url, check_crc=not arguments.no_crc) as client:
            channel = client.subscribe(channel_name=arguments.channel)
            print(f"{client.server.software}: channel {channel.name}, {channel.width_px} x {channel.height_px} pixels,"
                  f" {channel.band_lo_um:g} to {channel.band_hi_um:g} um", flush=True)
            try:
                receive(client, arguments)
            except (ClosedError, KeyboardInterrupt) as end:
                print(end or "interrupted", file=sys.stderr)
            counters = client.counters
    except EmitError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{counters.received} complete, {counters.partial} partial, {counters.lost} lost, {counters.skipped} skipped,"
          f" {counters.crc_errors} with a wrong checksum")
    return 0 if counters.partial + counters.lost + counters.crc_errors == 0 else 1


def receive(client: FrameClient, arguments: argparse.Namespace) -> None:
    for frame in client.frames(arguments.frames, arguments.timeout_s):
        # Frames in shared memory are views of it. A copy cannot be overwritten while it is used.
        frame = frame.copy()
        header = frame.header
        print(f"frame {header.frame_number}: host frame {header.host_frame_number}, {frame.pixels.min():.4g} to"
              f" {frame.pixels.max():.4g} W m-2 sr-1, {' '.join(sorted(header.flags))}", flush=True)
        if arguments.out is not None:
            np.save(arguments.out / f"frame_{header.frame_number:06}.npy", frame.pixels)


if __name__ == "__main__":
    sys.exit(main())
