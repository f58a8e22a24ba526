"""Draws the tables of an evaluation in the terminal."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from simbev_ros.evaluation.tables import Cell, CellKind, FigureTable, evaluation_tables, text_of
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.files.whole_files import write_errors, write_whole

_MAX_WIDTH = 1000
"""Maximum number of characters of a table's line in a file."""


def write_figures(file: Path, figures: Mapping[str, Any], console: Console) -> None:
    """Write figures as JSON, and print where; raises what ``write_errors`` raises."""
    with write_errors(file):
        write_whole(file, json.dumps(figures, indent=2).encode() + b"\n")
    console.print(f"figures in {file}", soft_wrap=True)


def print_tables(figures: Mapping[str, Any], console: Console) -> None:
    """Print ``evaluation.figures.figures_of`` as tables."""
    frames = figures["frames"]
    answered = ", ".join(
        f"{frames[f'answered_{what}']} with {what}" for what in ("boxes", "grids") if frames[f"answered_{what}"]
    )
    counted = f"{plural(frames['evaluated'], 'frame')} of {plural(frames['scenes'], 'scene')}"
    console.print(f"{counted}; answered: {answered or 'none'}", soft_wrap=True)
    left_out = figures.get("detection", {}).get("left_out", {})
    reasons = {"of_other_classes": "of other classes", "unseen": "without a point that no camera sees"}
    counts = [f"{left_out[name]:,} {words}" for name, words in reasons.items() if left_out.get(name)]
    if counts:
        console.print(f"boxes that do not count: {', '.join(counts)}", soft_wrap=True)
    print_figure_tables(evaluation_tables(figures), console)


def print_figure_tables(tables: Iterable[FigureTable], console: Console) -> None:
    """Print tables; in a file nothing is cut off."""
    for figure_table in tables:
        table = _draw(figure_table)
        if not console.is_terminal:
            unlimited = console.options.update(max_width=_MAX_WIDTH)
            console.width = max(console.width, console.measure(table, options=unlimited).maximum)
        console.print(table)


def _draw(figure_table: FigureTable) -> Table:
    first, *others = figure_table.heads
    table = Table(first, title=figure_table.title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for head in others:
        table.add_column(head, justify="right")
    for row in figure_table.rows:
        table.add_row(*map(_text, row))
    return table


def _text(cell: Cell) -> str:
    if cell.kind in (CellKind.NAME, CellKind.COUNT):
        return str(cell.value)
    return text_of(cell.value if isinstance(cell.value, float) else None)
