#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes Prometheus' alerting rules from the section "Alarms" of deploy/docs/operations.md.

Usage: alert_rules.py [--check]     --check: exit 1 if the file differs from what would be written

An alarm is a list item `- **name** (page|ticket): first sentence. Rest.` Code in the first sentence
that ends in `_total` stands for an increase of that counter; code that compares an `emitd_` metric
is taken as it is. Alarms whose threshold is the reader's own budget have neither, and get no rule.
"""
import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCE = ROOT / "deploy/docs/operations.md"
TARGET = ROOT / "deploy/monitoring/emitd.rules.yml"
ITEM = re.compile(r"^- \*\*(?P<name>[^*]+)\*\* \((?P<severity>page|ticket)[^)]*\): (?P<text>.*)$")


def items(text):
    """Yields the list items of the section as one line each."""
    section = text.split("\n## Alarms\n", 1)[1].split("\n## ", 1)[0]
    item = None
    for line in section.splitlines():
        if line.startswith("- "):
            if item:
                yield item
            item = line
        elif item and line.startswith("  "):
            item += " " + line.strip()
        elif item:
            yield item
            item = None
    if item:
        yield item


def expression(sentence):
    """Returns the condition in PromQL; empty if the sentence has none."""
    terms = []
    for code in re.findall(r"`([^`]+)`", sentence):
        if re.fullmatch(r"[a-z0-9_]+_total", code):
            terms.append(f"increase(emitd_{code.removeprefix('emitd_')}[1m]) > 0")
        elif "emitd_" in code and re.search(r"[<>=]", code):
            # A range is what a reader adds by himself: the text leaves it out.
            terms.append(re.sub(r"increase\((emitd_[^\[\]]*)\)", r"increase(\1[1m])", code))
    return " or ".join(terms)


def rules():
    """Returns the text of the rules file."""
    lines = [
        "# SPDX-License-Identifier: Apache-2.0",
        "# Written by deploy/scripts/alert_rules.py from deploy/docs/operations.md, which explains each alarm.",
        "groups:",
        "  - name: emitd",
        "    rules:",
    ]
    for item in items(SOURCE.read_text(encoding="utf-8")):
        match = ITEM.match(item)
        if not match:
            continue
        sentence, _, rest = match["text"].partition(". ")
        condition = expression(sentence)
        if not condition:
            continue
        words = re.sub(r"[^A-Za-z0-9 ]", " ", match["name"]).split()
        name = "Emitd" + "".join(word[0].upper() + word[1:] for word in words)
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", rest).replace("`", "")
        lines += [
            f"      - alert: {name}",
            f"        expr: {json.dumps(condition)}",
            "        labels:",
            f"          severity: {match['severity']}",
            "        annotations:",
            f"          summary: {json.dumps(match['name'])}",
            f"          description: {json.dumps(plain)}",
        ]
    return "\n".join(lines) + "\n"


def main():
    text = rules()
    if sys.argv[1:] == ["--check"]:
        if not TARGET.exists() or TARGET.read_text(encoding="utf-8") != text:
            print(f"alert_rules: {TARGET.relative_to(ROOT)} is not up to date; run {sys.argv[0]}", file=sys.stderr)
            return 1
        return 0
    if sys.argv[1:]:
        print(__doc__, file=sys.stderr)
        return 2
    TARGET.parent.mkdir(exist_ok=True)
    TARGET.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
