"""Reads tables and printed commands from the Markdown pages of the guide."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]


def page(name: str) -> str:
    """Text of a page of the guide."""
    return (ROOT / "docs" / "guide" / f"{name}.md").read_text(encoding="utf-8")


def rows(text: str, first_heading: str) -> Iterator[list[str]]:
    """Cells of each row of the table whose first column has a heading."""
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith(f"| {first_heading} |"):
            break
    next(lines)
    for line in lines:
        if not line.startswith("|"):
            return
        yield [cell.strip() for cell in line.strip("|").split("|")]


def quoted(cell: str) -> str | None:
    """The code that a cell begins with; None if it begins with something else."""
    found = re.match(r"`([^`]+)`", cell)
    return found[1] if found else None


def commands(text: str) -> list[str]:
    """Printed lines for a shell."""
    blocks = re.findall(r"^```sh\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.splitlines() if line]
