"""``simbev bench``: ticks per second of the demo rig, and where the time goes."""

import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Timing


def bench(
    config: Annotated[str, typer.Argument(help="Configuration to time: a file, or demo, live, paper.")] = "demo",
    ticks: Annotated[int, typer.Option(help="Ticks to time.", min=5, max=10_000)] = 40,
    record: Annotated[bool, typer.Option(help="Record too, to a temporary folder.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Time the whole graph: ticks per second, and for each node the time per tick and the processor time.

    [bold]Examples[/]

    simbev bench

    simbev bench live --no-record --json
    """
    from simbev_ros.cli.timing import timed_graph

    scenario = load_scenario(config)
    timing = Timing(
        tick_s=scenario.time.tick_s, warm_up_s=scenario.time.warm_up_s, duration_s=ticks * scenario.time.tick_s
    )
    scenario = scenario.model_copy(update={"time": timing, "scenes": scenario.scenes[:1]})
    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
        result = timed_graph(scenario, Path(folder) / "dataset" if record else None)
    if as_json:
        typer.echo(json.dumps(asdict(result), indent=2))
        return
    table = Table("process", "busy ms/tick", "CPU ms/tick", "memory MiB", title=f"{result.ticks_per_s:.2f} ticks/s")
    for row in result.processes:
        table.add_row(row.name, f"{row.busy_ms:.1f}", f"{row.cpu_ms:.1f}", f"{row.memory_mib:.0f}")
    Console().print(table)
