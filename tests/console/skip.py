# SPDX-License-Identifier: Apache-2.0
"""Ends a test that cannot run on this machine with the exit code that CTest takes for skipped."""
import importlib
import sys

SKIPPED = 77
PACKAGES = {"websockets": "python3-websockets", "numpy": "python3-numpy", "google.protobuf": "python3-protobuf"}


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(SKIPPED)


def skip_without(*modules):
    for module in modules:
        try:
            importlib.import_module(module)
        except ImportError:
            skip(f"{sys.executable} has no module {module}; Debian's {PACKAGES[module]} brings it")
