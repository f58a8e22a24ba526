"""Checks of Markdown: links to files and anchors, and paths of the code that pages name."""

import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from tools.docs.markdown import slug

_FENCE = re.compile(r"^(```+|~~~+).*?^\1\s*$", re.DOTALL | re.MULTILINE)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)\)")
_INLINE_CODE = re.compile(r"`[^`\n]*`")
_HEADING = re.compile(r"^#{1,6} (.+?)\s*$", re.MULTILINE)
_NEW = ("<!-- new file -->", "(new)")
_PATH = re.compile(r"(?<![\w/.-])(?:simbev_ros|test|tools|config|docs|deploy)/[\w./-]*\w/?")


def broken_links(page: Path, root: Path) -> list[str]:
    """What is wrong with the relative links of a page, a line each."""
    problems = []
    for target in _targets(page.read_text(encoding="utf-8")):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.is_relative_to(root):
            problems.append(f"{target}: outside of the repository")
        elif not file.exists():
            problems.append(f"{target}: no such file")
        elif anchor and anchor not in anchors(file):
            problems.append(f"{target}: no such heading")
    return problems


@lru_cache(maxsize=256)
def anchors(page: Path) -> tuple[str, ...]:
    """Anchors of a page's headings; the second of two equal ones has ``-1``, as on forges."""
    found: dict[str, int] = {}
    result = []
    for heading in headings(page.read_text(encoding="utf-8")):
        name = slug(heading)
        count = found.get(name, 0)
        found[name] = count + 1
        result.append(name if count == 0 else f"{name}-{count}")
    return tuple(result)


def headings(text: str) -> list[str]:
    """Headings outside of code blocks."""
    return _HEADING.findall(_FENCE.sub("", text))


def missing_paths(page: Path, root: Path) -> list[str]:
    """Paths of files of the repository that a page names in code, and that do not exist.

    A path on a line with ``(new)`` or with the comment ``<!-- new file -->`` is one that the reader creates.
    """
    text = page.read_text(encoding="utf-8")
    named = {path for span in _code(text) for path in _PATH.findall(span)}
    new = {path for line in text.splitlines() if any(mark in line for mark in _NEW) for path in _PATH.findall(line)}
    return sorted(path for path in named - new if not (root / path).exists())


def _targets(text: str) -> Iterator[str]:
    """Relative targets of links, outside of code."""
    plain = _INLINE_CODE.sub("``", _COMMENT.sub("", _FENCE.sub("", text)))
    for target in _LINK.findall(plain):
        if not re.match(r"[a-z]+:", target):
            yield target


def _code(text: str) -> Iterator[str]:
    """Inline code and code blocks, where paths are."""
    for block in _FENCE.finditer(text):
        yield block[0]
    yield from _INLINE_CODE.findall(_FENCE.sub("", text))
