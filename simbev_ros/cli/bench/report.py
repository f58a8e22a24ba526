"""What people see of a benchmark: a bar while it runs, a table or JSON at its end."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]


def progress_bar(what: str, console: Console) -> Progress:
    """A bar that counts."""
    columns = (TextColumn(what), BarColumn(bar_width=None), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, expand=True, transient=True)


def show_timing(
    result: Any,
    title: str,
    columns: tuple[str, ...],
    rows: Sequence[tuple[str, ...]],
    *,
    as_json: bool,
    comparison: str = "",
) -> None:
    """Print a result as a table with a sentence below, or as it is in JSON."""
    if as_json:
        typer.echo(json.dumps(asdict(result), indent=2))
        return
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    if comparison:
        Console(stderr=True).print(comparison, style="dim", highlight=False)
