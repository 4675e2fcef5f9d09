# SPDX-License-Identifier: Apache-2.0
"""A real emitd with canned frames and a console."""
from daemon import Daemon

WIDTH_PX, HEIGHT_PX = 160, 120
STEP_NS = 5_000_000
IG_CLOCK = 'mode = "ig-clock"\nrate_hz = 50.0'


def start(pacing, address="127.0.0.1:0", more=""):
    return Daemon(WIDTH_PX, HEIGHT_PX, pacing, more=f'[console]\nlisten = "{address}"\nrate_hz = 20.0\n{more}')


def address_of(daemon):
    return daemon.console.removeprefix("http://").rstrip("/")
