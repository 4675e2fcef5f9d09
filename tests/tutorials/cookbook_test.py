# SPDX-License-Identifier: Apache-2.0
"""Runs the shell snippets of deploy/docs/cookbook.md as one script that ends at the first failure."""
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "deploy/docs/cookbook.md"


def main():
    snippets = re.findall(r"^```sh\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    if not snippets:
        print(f"{PAGE} has no shell snippets")
        return 1
    with tempfile.TemporaryDirectory() as folder:
        script = pathlib.Path(folder) / "script.sh"
        script.write_text("set -euo pipefail\n" + "".join(f"echo '--- snippet {number}'\n{snippet}"
                                                          for number, snippet in enumerate(snippets, 1)),
                          encoding="utf-8")
        environment = {**os.environ, "PATH": f"{os.environ['TEST_BIN_DIR']}:{os.environ['PATH']}"}
        # A group of its own: a failure leaves daemons behind, which end with it.
        process = subprocess.Popen(["bash", script], cwd=folder, env=environment, start_new_session=True)
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
        try:
            code = process.wait(540)
        finally:
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        if code != 0:
            for log in sorted(pathlib.Path(folder).glob("*.log")):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-2000:]}")
    return code


if __name__ == "__main__":
    sys.exit(main())
