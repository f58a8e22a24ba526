"""``simbev bench``: ticks per second of a configuration and where the time goes; or the cost of ever more actors."""

import json
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Timing


def bench(
    config: Annotated[str, typer.Argument(help="Configuration to time: a file, or demo, live, paper.")] = "demo",
    ticks: Annotated[int, typer.Option(help="Ticks to time.", min=5, max=10_000)] = 40,
    record: Annotated[bool, typer.Option(help="Record too, to a temporary folder.")] = True,
    world: Annotated[
        str | None,
        typer.Option(help="Time the world node alone on this map instead, with 50 to 950 actors.", metavar="MAP"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Time the whole graph: ticks per second, and for each node the time per tick and the processor time.

    With --world, time the world node's ticks (traffic, motion, publishing) on one map with 50, 150, 300, 600 and 950
    actors, a third of them vehicles. The growth is the exponent of the number of actors: at most 1 is at most linear.

    [bold]Examples[/]

    simbev bench

    simbev bench live --no-record --json

    simbev bench --world Town10HD --ticks 200
    """
    scenario = load_scenario(config)
    timing = Timing(
        tick_s=scenario.time.tick_s, warm_up_s=scenario.time.warm_up_s, duration_s=ticks * scenario.time.tick_s
    )
    scenario = scenario.model_copy(update={"time": timing, "scenes": scenario.scenes[:1]})
    if world is not None:
        from simbev_ros.cli.world_timing import timed_world

        grown = timed_world(scenario, world)
        _show(
            grown,
            f"world node on {grown.map}, growth {grown.growth:.2f}",
            ("vehicles", "people", "busy ms/tick", "99th percentile", "CPU ms/tick"),
            [
                (f"{row.vehicles}", f"{row.people}", f"{row.mean_ms:.1f}", f"{row.p99_ms:.1f}", f"{row.cpu_ms:.1f}")
                for row in grown.scenes
            ],
            as_json=as_json,
        )
        return
    from simbev_ros.cli.timing import timed_graph

    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
        result = timed_graph(scenario, Path(folder) / "dataset" if record else None)
    _show(
        result,
        f"{result.ticks_per_s:.2f} ticks/s",
        ("process", "busy ms/tick", "CPU ms/tick", "memory MiB"),
        [(row.name, f"{row.busy_ms:.1f}", f"{row.cpu_ms:.1f}", f"{row.memory_mib:.0f}") for row in result.processes],
        as_json=as_json,
    )


def _show(result: Any, title: str, columns: tuple[str, ...], rows: Sequence[tuple[str, ...]], *, as_json: bool) -> None:
    """Print a result as a table, or as it is in JSON."""
    if as_json:
        typer.echo(json.dumps(asdict(result), indent=2))
        return
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
