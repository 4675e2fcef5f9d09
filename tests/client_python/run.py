# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of one file of this folder: run.py NAME. Exits 77 where the client cannot run on this machine."""
import importlib
import sys
import unittest

SKIPPED = 77

for module in ("google.protobuf", "numpy"):
    try:
        importlib.import_module(module)
    except ImportError:
        print(f"skipped: {sys.executable} has no module {module}; Debian's python3-protobuf and python3-numpy bring it")
        sys.exit(SKIPPED)

sys.dont_write_bytecode = True
unittest.main(module=sys.argv[1], argv=[sys.argv[0], "--verbose", *sys.argv[2:]])
