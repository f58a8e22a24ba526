"""The output of a benchmark: a table, or JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.table import Table

from simbev_ros.cli.console import make_console

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
    make_console().print(table)
    if comparison:
        make_console(stderr=True).print(comparison, style="dim", highlight=False)
