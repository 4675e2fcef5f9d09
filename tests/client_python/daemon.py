# SPDX-License-Identifier: Apache-2.0
"""A real emitd with canned frames on free ports, and the tool `emit`, whose client is in C++."""
import json
import os
import pathlib
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import uuid
import zlib

import numpy as np

# The name has no EMIT_ in front, because emitd refuses variables of that kind that it does not know.
BIN_DIR = pathlib.Path(os.environ["TEST_BIN_DIR"])
READY_TIMEOUT_S = 60.0


class Daemon:
    """Starts emitd and waits for its ready line; kills it at the end if need be."""

    def __init__(self, width_px=64, height_px=48, pacing='mode = "host-step"', host_more="", more="",
                 address="127.0.0.1", head=""):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="emitd_test_"))
        self.shm = f"test-{uuid.uuid4().hex[:12]}"
        config = self.folder / "daemon.toml"
        config.write_text(
            f'{head}[source]\nkind = "canned"\ncanned_width_px = {width_px}\ncanned_height_px = {height_px}\n'
            f'canned_frames = 8\n[pacing]\n{pacing}\n[host]\nudp = "{address}:0"\n{host_more}\n'
            f'[control]\ntcp = "{address}:0"\n'
            f'[stream]\nshm = "{self.shm}"\n{more}')
        self._log = (self.folder / "stderr").open("wb")
        self.process = subprocess.Popen([BIN_DIR / "emitd", "--config", config], stdout=subprocess.PIPE,
                                        stderr=self._log)
        self._take_ready_line()

    def _take_ready_line(self):
        try:
            ready = self._read_ready_line()
        except BaseException:
            self.close()
            raise
        words = dict(word.split("=", 1) for word in ready.split()[1:])
        self.console = words.get("console")
        self.control = words["control"]
        self.host_udp = words["host_udp"]
        self.metrics = words.get("metrics")
        self.tcp_url, self.udp_url = f"tcp://{self.control}", f"udp://{self.control}"
        self.shm_url = f"shm://{self.shm}"
        self.frame_urls = {"tcp": self.tcp_url, "udp": self.udp_url, "shm": self.shm_url}
        self.host_url = f"udp://{self.host_udp}"

    def log(self):
        return (self.folder / "stderr").read_text()

    def stop(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        return self.process.wait(READY_TIMEOUT_S)

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()
        self._log.close()
        # A daemon that was killed leaves its shared memory behind.
        pathlib.Path(f"/dev/shm/emitd-{self.shm}").unlink(missing_ok=True)
        shutil.rmtree(self.folder)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _read_ready_line(self):
        said = b""
        end_s = time.monotonic() + READY_TIMEOUT_S
        while time.monotonic() < end_s:
            if select.select([self.process.stdout], [], [], 1.0)[0]:
                piece = os.read(self.process.stdout.fileno(), 4096)
                said += piece
                for line in said.split(b"\n")[:-1]:
                    if line.startswith(b"ready control="):
                        return line.decode()
                if not piece:
                    break
        raise AssertionError(f"emitd is not ready: {self.log()}")


class ToolReceiver:
    """`emit receive` with the frames that it writes as images."""

    def __init__(self, daemon, url, frames):
        self._folder = daemon.folder / f"tool-{uuid.uuid4().hex[:8]}"
        self._log_name = daemon.folder / f"{self._folder.name}.err"
        self._log = self._log_name.open("wb")
        self._process = subprocess.Popen(
            [BIN_DIR / "emit", "receive", url, "--frames", str(frames), "--out", self._folder, "--json",
             daemon.folder / f"{self._folder.name}.json"], stdout=subprocess.DEVNULL, stderr=self._log)
        self._json = daemon.folder / f"{self._folder.name}.json"

    def wait_subscribed(self):
        end_s = time.monotonic() + READY_TIMEOUT_S
        while b", channel 0" not in self._log_name.read_bytes():
            if self._process.poll() is not None or time.monotonic() > end_s:
                raise AssertionError(f"emit receive: {self._log_name.read_text()}")
            time.sleep(0.01)

    def wait(self):
        """Returns the images by frame number, and the results as JSON."""
        try:
            self._process.wait(READY_TIMEOUT_S)
        finally:
            self.close()
        images = {int(file.stem.split("_")[1]): read_exr(file.read_bytes()) for file in self._folder.glob("*.exr")}
        return images, json.loads(self._json.read_text())

    def close(self):
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._log.close()


def read_exr(data):
    """Returns the image of an OpenEXR file with one channel of float32 in ZIP chunks, as `emit receive` writes it."""
    assert data[:4] == b"v/1\x01"
    attributes, at = {}, 8
    while data[at]:
        name, kind = data[at:].split(b"\0", 2)[:2]
        at += len(name) + len(kind) + 2
        size, = struct.unpack_from("<I", data, at)
        attributes[name.decode()] = data[at + 4:at + 4 + size]
        at += 4 + size
    assert attributes["compression"] == b"\x03"
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    out = np.empty((height, width), "<f4")
    chunks = -(-height // 16)
    for offset in struct.unpack_from(f"<{chunks}Q", data, at + 1):
        row, size = struct.unpack_from("<ii", data, offset)
        rows = min(16, height - (row - top))
        packed = data[offset + 8:offset + 8 + size]
        if size < rows * width * 4:
            # Deltas, modulo 256, of the first and then the second half of interleaved bytes.
            deltas = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
            deltas[1:] -= 128
            halves = np.cumsum(deltas).astype(np.uint8)
            split = (len(halves) + 1) // 2
            raw = np.empty(len(halves), np.uint8)
            raw[::2], raw[1::2] = halves[:split], halves[split:]
            packed = raw.tobytes()
        out[row - top:row - top + rows] = np.frombuffer(packed, "<f4").reshape(rows, width)
    return out


def example_file(name):
    """Returns an example program, which stands beside the package."""
    import emit_client
    return pathlib.Path(emit_client.__file__).parent.parent / "examples" / name


def run_example(name, *arguments):
    return subprocess.run([sys.executable, "-B", example_file(name), *map(str, arguments)], capture_output=True,
                          text=True, timeout=READY_TIMEOUT_S, stdin=subprocess.DEVNULL)
