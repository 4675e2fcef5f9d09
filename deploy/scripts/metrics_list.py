# SPDX-License-Identifier: Apache-2.0
"""The metrics of emitd, as its sources name them: server/rt/counters.hpp and server/telemetry/metrics_text.cpp."""
import dataclasses
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]
TEXT = r"((?:\"(?:[^\"\\]|\\.)*\"\s*)+)"
COUNTER = re.compile(r"X\((\w+),\s*" + TEXT + r"\)")
FAMILY = re.compile(r"(?:out\.family|each)\(\s*\"(\w+)\",\s*\"(counter|gauge|histogram)\",\s*" + TEXT)


@dataclasses.dataclass
class Metric:
    """A family of samples."""
    name: str
    type: str
    help: str

    def samples(self):
        """Returns the names under which Prometheus has it."""
        if self.type == "histogram":
            return {f"{self.name}_{suffix}" for suffix in ("bucket", "sum", "count")}
        return {self.name}


def joined(literals):
    return "".join(re.findall(r"\"((?:[^\"\\]|\\.)*)\"", literals)).replace('\\"', '"')


def metrics():
    """Returns every metric: counters first, in the order of the sources."""
    counters = (ROOT / "server/rt/counters.hpp").read_text(encoding="utf-8").replace("\\\n", "\n")
    families = (ROOT / "server/telemetry/metrics_text.cpp").read_text(encoding="utf-8")
    found = [Metric(f"emitd_{name}_total", "counter", joined(text)) for name, text in COUNTER.findall(counters)]
    found += [Metric(f"emitd_{name}", kind, joined(text)) for name, kind, text in FAMILY.findall(families)]
    return found
