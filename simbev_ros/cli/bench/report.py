"""The output of a benchmark: a table, or JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]


def show_timing(
    result: Any,
    title: str,
    columns: tuple[str, ...],
    rows: Sequence[tuple[str, ...]],
    *,
    as_json: bool,
    comparison: str = "",
) -> None:
    """Print a result as a table with a sentence below it, or its raw data as JSON."""
    if as_json:
        typer.echo(json.dumps(asdict(result), indent=2))
        return
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    if comparison:
        Console(stderr=True).print(comparison, style="dim", highlight=False)
