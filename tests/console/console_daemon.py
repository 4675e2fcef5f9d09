# SPDX-License-Identifier: Apache-2.0
"""A real emitd with canned frames and a console."""
import contextlib
import math
import pathlib
import signal
import socket
import subprocess
import tempfile
import threading

from cigi_host import OPERATE, CigiHost
from daemon import BIN_DIR, Daemon

WIDTH_PX, HEIGHT_PX = 160, 120
STEP_NS = 5_000_000
IG_CLOCK = 'mode = "ig-clock"\nrate_hz = 50.0'


class SceneDaemon(Daemon):
    """emitd with a rendered scenario, a console and a journal file."""

    def __init__(self, scenario, pacing, overrides=(), source=""):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="emitd_test_"))
        self.journal = self.folder / "run.mcap"
        self.shm = "none"
        self.overrides = [argument for each in overrides for argument in ("--set", each)]
        config = self.folder / "daemon.toml"
        config.write_text(
            f'scenario = "{scenario}"\n[source]\nkind = "renderer"\n{source}\n[pacing]\n{pacing}\n'
            f'[host]\nudp = "127.0.0.1:0"\n[control]\ntcp = "127.0.0.1:0"\n[journal]\nfile = "{self.journal}"\n'
            f'[console]\nlisten = "127.0.0.1:0"\nrate_hz = 20.0\n')
        self._log = (self.folder / "stderr").open("wb")
        self.process = subprocess.Popen([BIN_DIR / "emitd", "--config", config, *self.overrides],
                                        stdout=subprocess.PIPE, stderr=self._log)
        self._take_ready_line()


@contextlib.contextmanager
def replay_console(journal, scenario, overrides, *more):
    """`emit replay` with a console, on a free port. Yields its address."""
    process = subprocess.Popen(
        [BIN_DIR / "emit", "replay", journal, "--scenario", scenario, *overrides, "--console", "127.0.0.1:0", *more],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    reader = None
    said = []
    try:
        for line in process.stderr:
            if "console=http://" in line:
                # What follows is read on, so that the pipe does not fill up.
                reader = threading.Thread(target=lambda: said.append(process.stderr.read()))
                reader.start()
                yield line.split("console=http://")[1].strip().rstrip("/")
                return
        raise AssertionError("emit replay has no console")
    except TimeoutError as error:
        code = process.poll()
        process.send_signal(signal.SIGINT)
        if reader is not None:
            reader.join(60)
        raise TimeoutError(f"{error}; emit replay (exit status {code}) said:\n{''.join(said)}") from error
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)
        if reader is not None:
            reader.join()
        process.stderr.close()


def start(pacing, address="127.0.0.1:0", more="", head=""):
    return Daemon(WIDTH_PX, HEIGHT_PX, pacing, head=head,
                  more=f'[console]\nlisten = "{address}"\nrate_hz = 20.0\n{more}')


@contextlib.contextmanager
def swinging_axes(seconds, amplitude_rad, rate_rad_s, delay_s):
    """A daemon with a motion simulator of three axes that follow without error but `delay_s` late, and a host whose
    seeker swings about north in heading."""
    with contextlib.ExitStack() as stack:
        folder = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory()))
        table = subprocess.Popen([BIN_DIR / "emit", "fms-sim", "--listen", "127.0.0.1:0", "--axes", "3",
                              "--delay-ms", str(1000 * delay_s), "--noise-arcsec", "0"],
                                 stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        stack.callback(lambda: (table.send_signal(signal.SIGINT), table.wait(30), table.stdout.close()))
        controller = table.stdout.readline().split("axes_udp=")[1].strip()
        axes = "{ min_deg = -100, max_deg = 100, rate_deg_s = 300, acceleration_deg_s2 = 5000 }, " * 3
        motion = f'[motion]\ncontroller = "{controller}"\nfeedback_timeout_ms = 1000\naxes = [{axes}]\n'
        daemon = stack.enter_context(start(IG_CLOCK, more=motion))
        poses = folder / "poses.csv"
        with poses.open("w") as out:
            out.write("sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n")
            for i in range(100 * seconds):
                half_rad = 0.5 * amplitude_rad * math.sin(0.01 * rate_rad_s * i)
                # World from body for a heading: half a turn about the axis between north and east.
                c = math.sqrt(0.5) * (math.cos(half_rad) + math.sin(half_rad))
                s = math.sqrt(0.5) * (math.cos(half_rad) - math.sin(half_rad))
                out.write(f"{0.01 * i:.3f},0,0,10,0,{c!r},{s!r},0\n")
        host = subprocess.Popen([BIN_DIR / "emit", "send", poses, "--to", daemon.host_url],
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        stack.callback(lambda: (host.send_signal(signal.SIGINT), host.wait(30)))
        yield daemon


class CigiRig:
    """A daemon in lock step with a CIGI host. The channels are those of a scenario, so that they have temperatures."""

    def __init__(self, kind=CigiHost, display_k=(280, 330)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            listen = probe.getsockname()[1]
        self.host = kind(("127.0.0.1", listen))
        try:
            with tempfile.NamedTemporaryFile("w", suffix=".toml") as scenario:
                scenario.write(f'[sensor]\nwidth_px = {WIDTH_PX}\nheight_px = {HEIGHT_PX}\n[display]\n'
                               f'min_k = {display_k[0]}\nmax_k = {display_k[1]}\n'
                               '[[object]]\ngltf = "share:scenes/box.glb"\n')
                scenario.flush()
                self.daemon = start('mode = "host-step"', head=f'scenario = "{scenario.name}"\n', more=(
                    f'[cigi]\nlisten = "127.0.0.1:{listen}"\nhost = "127.0.0.1:{self.host.port}"\nrate_hz = 20.0\n'))
        except BaseException:
            self.host.close()
            raise
        self.host.begin()

    def step(self, **wishes):
        """Sends a pose, with Sensor Control where there are wishes, and waits for the next Start Of Frame."""
        self.host.send(self.host.control(OPERATE), self.host.entity(0, (48.0, 11.0, 100.0)),
                       *([self.host.sensor(**wishes)] if wishes else []))
        while self.host.receive()["last_host"] != self.host.host_frame:
            pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.daemon.close()
        self.host.close()


def address_of(daemon):
    return daemon.console.removeprefix("http://").rstrip("/")
