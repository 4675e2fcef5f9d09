# SPDX-License-Identifier: Apache-2.0
"""The repository's Markdown pages: their headings, anchors and links, and what is wrong with the links.

docs_site.py and docs.sh use it. Anchors are those that GitHub gives to headings.
"""
import dataclasses
import pathlib
import posixpath
import re
import subprocess
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parents[2]
HEADING = re.compile(r"^(#{1,6})[ \t]+(.*?)[ \t]*#*[ \t]*$")
FENCE = re.compile(r"^[ \t]*(```+|~~~+)")
CODE_SPAN = re.compile(r"(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.DOTALL)
INLINE_LINK = re.compile(r"(?P<image>!?)\[(?P<text>[^\[\]]*(?:\[[^\[\]]*\][^\[\]]*)*)\]\(\s*(?P<target>[^()\s]+)[^()]*\)")
DEFINITION = re.compile(r"^[ \t]{0,3}\[(?P<label>[^\]]+)\]:[ \t]*(?P<target>\S+)", re.MULTILINE)
REFERENCE = re.compile(r"\[(?P<text>[^\[\]]+)\]\[(?P<label>[^\[\]]*)\]")
HTML_ANCHOR = re.compile(r"<a\s+(?:id|name)=\"([^\"]+)\"")
EXTERNAL = re.compile(r"^[a-zA-Z][a-zA-Z0-9+.-]*:")


@dataclasses.dataclass
class Link:
    """A link of a page: where its target stands in the text, and the line for messages."""
    target: str
    begin: int
    end: int
    line: int
    image: bool


class Page:
    """A Markdown file of the repository."""

    def __init__(self, path, text=None):
        self.path = path
        self.text = (ROOT / path).read_text(encoding="utf-8") if text is None else text
        self.prose = without_code(self.text)
        self.headings = list(headings(self.text))
        self.anchors = {anchor for _, _, anchor in self.headings} | set(HTML_ANCHOR.findall(self.prose))

    def line_of(self, offset):
        return self.text.count("\n", 0, offset) + 1

    def links(self):
        """Yields inline links, images and definitions in the order of the text."""
        found = []
        for pattern in (INLINE_LINK, DEFINITION):
            for match in pattern.finditer(self.prose):
                found.append(Link(match["target"], match.start("target"), match.end("target"),
                                  self.line_of(match.start("target")), match.groupdict().get("image") == "!"))
                # The text of a link may be an image.
                for inner in INLINE_LINK.finditer(match.groupdict().get("text") or ""):
                    begin = match.start("text") + inner.start("target")
                    found.append(Link(inner["target"], begin, begin + len(inner["target"]), self.line_of(begin), True))
        return sorted(found, key=lambda link: link.begin)

    def undefined_labels(self):
        """Yields line and label of references to definitions that the page lacks."""
        defined = {match["label"].lower() for match in DEFINITION.finditer(self.prose)}
        for match in REFERENCE.finditer(self.prose):
            label = match["label"] or match["text"]
            if label.lower() not in defined:
                yield self.line_of(match.start()), label


def blanked(text):
    """Returns the text with everything but line ends as spaces: offsets and lines stay."""
    return re.sub(r"[^\n]", " ", text)


def without_code(text):
    """Returns the text with code blocks and code spans blanked."""
    lines, fence = [], ""
    for line in text.splitlines(keepends=True):
        match = FENCE.match(line)
        if fence:
            if match and match[1].startswith(fence):
                fence = ""
            line = blanked(line)
        elif match:
            fence = match[1]
            line = blanked(line)
        lines.append(line)
    # A code span does not reach over an empty line.
    parts = re.split(r"(\n[ \t]*\n)", "".join(lines))
    return "".join(CODE_SPAN.sub(lambda match: blanked(match[0]), part) for part in parts)


def plain(markup):
    """Returns the text of a heading without its markup."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", markup)
    text = re.sub(r"`+", "", text)
    return re.sub(r"(\*\*|\*|(?<!\w)_|_(?!\w))", "", text)


def slug(text):
    kept = re.sub(r"[^\w\- ]", "", text.lower())
    return kept.strip().replace(" ", "-")


def headings(text):
    """Yields line number, text and anchor of every heading outside code blocks."""
    fence, count = "", {}
    for number, line in enumerate(text.splitlines(), 1):
        match = FENCE.match(line)
        if match:
            if not fence:
                fence = match[1]
            elif match[1].startswith(fence):
                fence = ""
            continue
        match = None if fence else HEADING.match(line)
        if match:
            words = plain(match[2])
            anchor = slug(words)
            seen = count.get(anchor, 0)
            count[anchor] = seen + 1
            yield number, words, f"{anchor}-{seen}" if seen else anchor


def repository_files():
    """Returns the paths of the source tree: what git has or would add; in an unpacked archive what is there."""
    try:
        listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, check=True,
                                capture_output=True).stdout.decode().split("\0")
        return sorted(path for path in listed if path and (ROOT / path).is_file())
    except (OSError, subprocess.CalledProcessError):
        return sorted(str(path.relative_to(ROOT)) for path in ROOT.rglob("*")
                      if path.is_file() and path.relative_to(ROOT).parts[0] not in ("build", "out", ".git"))


def resolve(page_path, target):
    """Returns path in the repository and anchor of a link's target."""
    path, _, anchor = target.partition("#")
    path = urllib.parse.unquote(path)
    if not path:
        return page_path, anchor
    return posixpath.normpath(posixpath.join(posixpath.dirname(page_path), path)), anchor


def broken_links(pages, files):
    """Yields FILE:LINE: REASON for every internal link or anchor of the pages that leads nowhere."""
    known = set(files)
    folders = {parent.as_posix() for path in files for parent in pathlib.PurePosixPath(path).parents} - {"."}
    for page in pages.values():
        for link in page.links():
            if EXTERNAL.match(link.target):
                continue
            path, anchor = resolve(page.path, link.target)
            place = f"{page.path}:{link.line}"
            if link.target.startswith("/") or path.startswith("../"):
                yield f"{place}: {link.target} leaves the repository"
            elif path in pages:
                if anchor and anchor not in pages[path].anchors:
                    yield f"{place}: {path} has no heading #{anchor}"
            elif path not in known and path not in folders:
                yield f"{place}: {link.target} does not exist"
            elif anchor:
                yield f"{place}: {path} is no page and has no anchors"
        for line, label in page.undefined_labels():
            yield f"{page.path}:{line}: [{label}] has no definition"
