"""Words that CONTRIBUTING.md refuses are neither on pages nor in the code's docstrings, comments, help and messages."""

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("simbev_ros", "exporters/simbev_exporters", "training/simbev_training", "tools", "examples", "launch")
PAGES = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")} - {ROOT / "CONTRIBUTING.md"})
FILES = [*ROOT.glob("config/**/*.yaml"), ROOT / "simbev", ROOT / "setup.py"]
IS_NO = r"\b(?:is|are) no (?<!there is no )(?<!there are no )(?<!where is no )(?!longer\b|more\b|less\b)[a-z]"


def refused_words() -> re.Pattern[str]:
    """The right column of the table in CONTRIBUTING.md; what a colon follows is a field's name, not prose."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    rows = re.split(r"`test/docs/test_words.py`.*\n\n\| use \| not \|\n\|---\|---\|\n", text)[1].split("\n\n")[0]
    words = [word.strip() for row in rows.splitlines() for word in row.split("|")[2].split(",")]
    assert words.count("is no") == 1
    return re.compile(rf"\b(?:{'|'.join(set(words) - {'is no'})})(?:s|d|ing)?\b(?!:)|{IS_NO}")


WORDS = refused_words()


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text, in lower case, of each part of a file that people read; what is marked as code is left out."""
    text = path.read_text().lower()
    if path.suffix != ".py":
        parts = list(enumerate(text.splitlines(), 1))
    else:
        tokens = tokenize.generate_tokens(io.StringIO(text if WORDS.search(text) else "").readline)
        parts = [(each.start[0], each.string) for each in tokens if each.type != tokenize.NAME and " " in each.string]
    yield from ((line, re.sub(r"(`+).*?\1", "", part)) for line, part in parts)


@pytest.mark.parametrize("folder", ["pages", *FOLDERS])
def test_words_that_contributing_refuses_are_not_used(folder: str) -> None:
    paths = [*PAGES, *FILES] if folder == "pages" else (ROOT / folder).rglob("*.py")
    found = [
        f"{path.relative_to(ROOT)}:{line + part[: match.start()].count(chr(10))}: {match[0]}"
        for path in paths
        for line, part in prose(path)
        for match in WORDS.finditer(part)
    ]
    assert found == []


@pytest.mark.parametrize(
    ("text", "is_refused"),
    [
        ("somebody paints it in colours", True),
        ("a bag is no dataset", True),
        ("there is no bag, and it is no longer needed", False),
        ("signalised: whether it has traffic lights", False),
    ],
)
def test_refused_words_are_found_in_prose(text: str, is_refused: bool) -> None:
    assert bool(WORDS.search(text)) == is_refused
