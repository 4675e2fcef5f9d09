# SPDX-License-Identifier: Apache-2.0
"""Builds the documentation site from the pages where they lie, and checks every link. Run it by docs.sh.

Usage: docs_site.py --check-sources | --out DIR [--emit PROGRAM]

The pages are copied with their folders into a folder beside the site, so that relative links stay as they are. Folders
and source files that pages link become pages of their own. mkdocs takes another dialect than GitHub: lists get the
indentation and empty lines that it wants, and headings the anchors that GitHub gives them.
"""
import argparse
import html.parser
import json
import os
import pathlib
import posixpath
import re
import shutil
import subprocess
import sys
import textwrap
import urllib.parse

import metrics_list
from doc_pages import EXTERNAL, FENCE, HEADING, ROOT, Page, broken_links, headings, repository_files, resolve

SITE = ROOT / "deploy/site"
RAW = {".csv", ".json", ".png", ".svg", ".webp"}  # a browser shows these, or the reader wants them as they are
LEXERS = {".cpp": "cpp", ".hpp": "cpp", ".py": "python", ".sh": "bash", ".toml": "toml", ".yml": "yaml",
          ".proto": "protobuf", ".cmake": "cmake", ".ts": "typescript"}
ITEM = re.compile(r"^(?P<indent> *)(?P<marker>[-*+]|\d{1,9}[.)])(?P<space> +)(?=\S)")


def for_mkdocs(text):
    """Returns a page in mkdocs' dialect: GitHub's anchors, four spaces per level of lists, empty lines before blocks."""
    anchors = {number: anchor for number, _, anchor in headings(text)}
    lines = text.splitlines()
    out, fence, fence_shift, loose = [], "", 0, False
    levels = []  # where the text of each enclosing list item begins
    code = False  # inside of an indented block of code
    for number, line in enumerate(lines, 1):
        before = out[-1] if out else ""
        if fence:
            out.append(" " * fence_shift + line if fence_shift >= 0 else line[-fence_shift:])
            if line.strip() and not line.strip().strip(fence[0]) and len(line.strip()) >= len(fence):
                fence = ""
            continue
        if not line.strip():
            loose = loose or bool(levels)
            out.append("")
            continue
        indent = len(line) - len(line.lstrip(" "))
        if indent >= (levels[-1] if levels else 0) + 4 and (code or not before.strip()):
            code = True
            out.append(" " * (4 * len(levels) + indent - (levels[-1] if levels else 0)) + line.lstrip(" "))
            continue
        code = False
        item, opened, heading = ITEM.match(line), FENCE.match(line), HEADING.match(line)
        row = line.lstrip().startswith("|")
        # Text that begins further left goes on with the paragraph of the item above, unless an empty line ends it.
        if not before.strip() or item or opened or heading or row:
            while levels and indent < levels[-1]:
                levels.pop()
        content = line.lstrip(" ")
        shift = 4 * len(levels)
        if item:
            if before.strip() and (loose or not levels and not ITEM.match(before) and not before.startswith(" ")):
                out.append("")
            levels.append(len(item[0]))
        elif opened:
            fence, fence_shift = opened[1], shift - indent
            if before.strip():
                out.append("")
        elif heading:
            content = f"{content.rstrip(' #')} {{#{anchors[number]}}}"
            if before.strip():
                out.append("")
        elif row and before.strip() and not before.lstrip().startswith("|"):
            out.append("")
        if not levels:
            loose = False
        out.append(" " * shift + content)
    return "\n".join(out) + "\n"


def fenced(text, lexer):
    fence = "```"
    while fence in text:
        fence += "`"
    return f"{fence}{lexer}\n{text.rstrip()}\n{fence}\n"


def wrapped(text, columns=104):
    """Returns the text of a help with long lines wrapped below the beginning of their explanation."""
    lines = []
    for line in text.splitlines():
        explained = re.match(r"^ +\S.*?  +(?=\S)|^ +", line)
        lines += textwrap.wrap(line, columns, subsequent_indent=" " * min(len(explained[0]) if explained else 0, 40),
                               break_long_words=False, break_on_hyphens=False, drop_whitespace=True) or [""]
    return "\n".join(lines)


class Staging:
    """The folder that mkdocs reads."""

    def __init__(self, folder, pages, files):
        self.folder, self.pages, self.files = folder, pages, files
        self.done = set()

    def write(self, path, text):
        target = self.folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")

    def source(self, path):
        """Makes a file or folder that a page links, and returns where it is."""
        inside = [file for file in self.files if file.startswith(path + "/")]
        if not inside and pathlib.PurePosixPath(path).suffix in RAW:
            if path not in self.done:
                (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / path, self.folder / path)
            self.done.add(path)
            return path
        page = f"source/{path}.md"
        if page not in self.done:
            parts = [f"# {path}\n"]
            for file in inside or [path]:
                name = pathlib.PurePosixPath(file)
                if name.suffix == ".md" or name.suffix in RAW:
                    continue
                if inside:
                    parts.append(f"## {posixpath.relpath(file, path)}\n")
                parts.append(fenced((ROOT / file).read_text(encoding="utf-8"), LEXERS.get(name.suffix, "")))
            self.write(page, for_mkdocs("\n".join(parts)))
        self.done.add(page)
        return page

    def add(self, page):
        """Copies a page; its links to sources lead to what source() made."""
        text, last, out = page.text, 0, []
        for link in page.links():
            if EXTERNAL.match(link.target):
                continue
            path, _ = resolve(page.path, link.target)
            if path in self.pages:
                continue
            place = self.source(path)
            if place != path:
                out += [text[last:link.begin], posixpath.relpath(place, posixpath.dirname(page.path) or ".")]
                last = link.end
        self.write(page.path, for_mkdocs("".join(out) + text[last:]))


def commands_page(emit):
    """Returns the reference of commands, from the help of the program itself."""
    head = "# Commands\n\n"
    if not emit:
        return head + ("This copy of the site was built without the program, so this page is empty. "
                       "`emit --help` and `emit COMMAND --help` have its content. To fill the page, build emit and "
                       "name it: `EMIT_BIN=build/release/bin deploy/scripts/docs.sh`.\n")

    def help_of(*command, program=emit):
        result = subprocess.run([program, *command, "--help"], check=True, capture_output=True, text=True)
        # Where the data of this build are is of no use to a reader.
        return re.sub(r"/\S*/share/emit(?![\w-])", "/usr/share/emit", result.stdout)

    def subcommands(text):
        match = re.search(r"^Subcommands:\n((?:  .*\n)+)", text, re.MULTILINE)
        return re.findall(r"^  ([a-z][a-z0-9-]*)(?:\s|$)", match[1], re.MULTILINE) if match else []

    version = subprocess.run([emit, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    overview = help_of()
    names = subcommands(overview)
    body = [head, f"What the programs print with `--help` ({version.split(' (')[0]}). `emit-lab` has the commands that "
            "need the reference solver: `emit` calls it by itself. `man emit-render` shows the same page where the "
            "packages are installed.\n\n## emit\n", fenced(wrapped(overview), "text")]
    daemon = pathlib.Path(emit).with_name("emitd")
    if daemon.exists():
        body += ["## emitd\n", fenced(wrapped(help_of(program=daemon)), "text")]
    for name in names:
        text = help_of(name)
        body += [f"## emit {name}\n", fenced(wrapped(text), "text")]
        for inner in subcommands(text):
            body += [f"### emit {name} {inner}\n", fenced(wrapped(help_of(name, inner)), "text")]
    return "\n".join(body)


def metrics_page():
    """Returns the table of all metrics, from the sources, and where the operations page speaks of each."""
    operations = Page("deploy/docs/operations.md")
    lines = operations.text.splitlines()
    rows = ["# Metrics\n", "Every metric of `/metrics`, as the sources of the daemon name it. "
            "[Operations](../deploy/docs/operations.md#alarms) says what to do when one is wrong. Histograms have "
            "`_bucket`, `_sum` and `_count`.\n", "| metric | type | meaning | alarms |", "|---|---|---|---|"]
    for metric in metrics_list.metrics():
        word = re.compile(rf"(?<![a-z_])(?:emitd_)?{metric.name.removeprefix('emitd_')}(?![a-z])")
        mentioned = []
        for number, line in enumerate(lines, 1):
            if word.search(line):
                _, words, anchor = [heading for heading in operations.headings if heading[0] <= number][-1]
                link = f"[{words}](../deploy/docs/operations.md#{anchor})"
                if link not in mentioned:
                    mentioned.append(link)
        rows.append(f"| `{metric.name}` | {metric.type} | {metric.help.replace('|', chr(92) + '|')} | "
                    f"{', '.join(mentioned)} |")
    return "\n".join(rows) + "\n"


class SitePage(html.parser.HTMLParser):
    """Anchors and links of a page of the site."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.loads = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        for key in ("id", "name"):
            if values.get(key):
                self.ids.add(values[key])
        line = self.getpos()[0]
        if tag in ("a", "area") and values.get("href"):
            self.links.append((line, values["href"]))
        loads = [values.get("src"), values.get("href") if tag == "link" else None, values.get("data"),
                 values.get("poster")]
        loads += [part.split()[0] for part in (values.get("srcset") or "").split(",") if part.strip()]
        self.loads += [(line, target) for target in loads if target]


def site_faults(site):
    """Yields what is wrong in the built site: links and anchors that lead nowhere, and requests to other machines."""
    pages = {path: SitePage(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        for line, target in page.links + page.loads:
            place = f"{path.relative_to(site)}:{line}"
            if EXTERNAL.match(target) or target.startswith("//"):
                if (line, target) in page.loads and not target.startswith("data:"):
                    yield f"{place}: loads {target} from elsewhere"
                continue
            name, _, anchor = target.partition("#")
            goal = (path.parent / urllib.parse.unquote(name.split("?")[0])).resolve() if name else path
            if goal.is_dir():
                goal = goal / "index.html"
            if path.name == "404.html" and target.startswith("/"):
                continue  # the page for servers; it knows no place of its own
            if not goal.exists():
                yield f"{place}: {target} does not exist"
            elif anchor and goal in pages and urllib.parse.unquote(anchor) not in pages[goal].ids:
                yield f"{place}: {target}: no such anchor"
    for path in sorted(site.rglob("*.css")):
        for match in re.finditer(r"(?:url\(|@import)\s*['\"]?((?:https?:)?//[^'\")]+)", path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(site)}: loads {match[1]} from elsewhere"


def in_navigation(text):
    """Returns the pages that deploy/site/mkdocs.yml has in its navigation."""
    return re.findall(r"^ +- [^:\n]+: (\S+\.md)$", text.split("\nnav:\n", 1)[1], re.MULTILINE)


def navigation_faults(pages):
    """Yields the pages that the navigation lacks, and its entries without a page."""
    listed = set(in_navigation((SITE / "mkdocs.yml").read_text(encoding="utf-8")))
    expected = set(pages) | {"reference/commands.md", "reference/metrics.md"}
    for path in sorted(expected - listed):
        yield f"deploy/site/mkdocs.yml: the navigation lacks {path}"
    for path in sorted(listed - expected):
        yield f"deploy/site/mkdocs.yml: {path} does not exist"


def build(out, emit, pages, files):
    work = out.with_name(out.name + ".work")
    shutil.rmtree(work, ignore_errors=True)
    settings = (SITE / "mkdocs.yml").read_text(encoding="utf-8")
    staging = Staging(work / "pages", pages, files)
    for page in pages.values():
        staging.add(page)
    staging.write("reference/commands.md", for_mkdocs(commands_page(emit)))
    staging.write("reference/metrics.md", for_mkdocs(metrics_page()))
    shutil.copytree(SITE / "theme", work / "theme")
    (work / "mkdocs.yml").write_text(settings, encoding="utf-8")

    shutil.rmtree(out, ignore_errors=True)
    # Pages that only links reach are not in the navigation, which mkdocs tells as information.
    result = subprocess.run(["mkdocs", "build", "--quiet", "--config-file", str(work / "mkdocs.yml"), "--site-dir",
                             str(out)], capture_output=True, text=True,
                            env={**os.environ, "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH", "0")})
    if result.returncode != 0 or result.stderr.strip():
        return [f"mkdocs: {line}" for line in (result.stderr.strip() or "failed").splitlines()]
    index = json.loads((out / "search/search_index.json").read_text(encoding="utf-8"))
    (out / "search/search_index.js").write_text("var __search_index = " + json.dumps(index, separators=(",", ":")) +
                                                ";\n", encoding="utf-8")
    for leftover in list(out.rglob("*.map")) + [out / "sitemap.xml", out / "sitemap.xml.gz"]:
        leftover.unlink(missing_ok=True)
    shutil.rmtree(out / "assets/javascripts/lunr", ignore_errors=True)  # languages other than English
    shutil.rmtree(work)
    return list(site_faults(out))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check-sources", action="store_true")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--emit", default="")
    options = parser.parse_args()
    files = repository_files()
    pages = {path: Page(path) for path in files if path.endswith(".md")}
    faults = list(broken_links(pages, files)) + list(navigation_faults(pages))
    if not faults and not options.check_sources:
        faults = build(options.out.resolve(), options.emit, pages, files)
    for fault in faults:
        print(fault, file=sys.stderr)
    if faults:
        print(f"docs: {len(faults)} faults", file=sys.stderr)
        return 1
    links = sum(len(page.links()) for page in pages.values())
    print(f"docs: {len(pages)} pages with {links} links" +
          ("" if options.check_sources else f"; site in {options.out}/index.html"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
