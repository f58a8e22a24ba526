"""Draws scenes for ``simbev scene`` without simulating them and prints statistics of their parameters."""

import json
import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from simbev_ros.cli.console import counting_bar, make_console, table_console
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, planned_scenes, start_positions
from simbev_ros.scene.drawing.statistics import BINS, SceneStatistics, Tally, configured_value

_WIDE = 120
_NAME_WIDTH, _FIGURE_WIDTH = 24, 8
_BARS = " ▁▂▃▄▅▆▇█"


def report_scenes(config: str, count: int | None, map_name: str | None, *, as_json: bool) -> None:
    """Draw the scenes of a configuration and print statistics of what was drawn.

    Args:
        config: Configuration file, or the name of a built-in one.
        count: Number of scenes; that of the configuration when None. After the last one they are repeated.
        map_name: Town or map file for all scenes, in place of the configuration's.
        as_json: Print JSON in place of tables.
    """
    scenario = load_scenario(config)
    planned = numbered_scenes(scenario, count, map_name)
    console = make_console(stderr=True)
    if scenario.accept is not None:
        console.print("these are first draws: the rules of accept are not applied", style="dim")
    statistics = SceneStatistics()
    with _counted_notes(console):
        for number, each in enumerate(dict.fromkeys(scene.map for scene in planned), 1):
            _draw(scenario, [scene for scene in planned if scene.map == each], statistics, console, number)
    if as_json:
        typer.echo(json.dumps(_facts(statistics, scenario), indent=2))
        return
    output = table_console()
    maps = ", ".join(f"{name} ({scenes})" for name, scenes in statistics.maps.items())
    output.print(Text.assemble((plural(len(planned), "scene"), "bold"), f": {maps}"))
    _print_numbers(output, statistics, scenario)
    output.print(_kinds_table(statistics))


def numbered_scenes(scenario: Scenario, count: int | None, map_name: str | None) -> list[PlannedScene]:
    """The scenes to draw; beyond the last one the configuration's scenes are repeated.

    Args:
        scenario: The configuration.
        count: Number of scenes; that of the configuration when None.
        map_name: Town or map file for all scenes, in place of the configuration's.

    Raises:
        InputError: There is no such map.
    """
    wanted = list(planned_scenes(scenario))
    if map_name is not None:
        chosen = map_spec(map_name)
        wanted = [each._replace(map=chosen) for each in wanted]
    numbers = range(len(wanted) if count is None else count)
    return [wanted[number % len(wanted)]._replace(number=number) for number in numbers]


def _draw(
    scenario: Scenario, planned: Sequence[PlannedScene], statistics: SceneStatistics, console: Console, number: int
) -> None:
    """Draw the scenes of one map."""
    name = planned[0].map.name
    with console.status(f"roads of {escape(name)}"):
        network = load_network(planned[0].map)
        starts = start_positions(scenario, network)
    with counting_bar(f"scenes on {name}", console, len(planned)) as bar:
        for each in planned:
            statistics.add(draw_scene(scenario, each, network, starts))
            bar.advance()


@contextmanager
def _counted_notes(console: Console) -> Iterator[None]:
    """Count the log messages while scenes are drawn; at the end print their number and the first one."""
    logger = logging.getLogger("simbev_ros.scene")
    messages: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: messages.append(record.getMessage())  # type: ignore[method-assign]
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
    if messages:
        console.print(f"{len(messages)} notes, the first: {messages[0]}", style="dim", soft_wrap=True)


def _facts(statistics: SceneStatistics, scenario: Scenario) -> dict[str, Any]:
    """The statistics as data for JSON."""
    return {
        "scenes": sum(statistics.maps.values()),
        "maps": dict(statistics.maps),
        "parameters": {
            name: {
                "meant": configured_value(name, scenario),
                "count": tally.count,
                "mean": tally.mean,
                "sd": tally.sd,
                "min": tally.min,
                "max": tally.max,
                "histogram": tally.shares().tolist(),
            }
            for name, tally in statistics.numbers.items()
        },
        "kinds": {name: dict(counts.most_common()) for name, counts in statistics.kinds.items()},
    }


def _print_numbers(output: Console, statistics: SceneStatistics, scenario: Scenario) -> None:
    """Print a line for each parameter, by section; in a narrow terminal its distribution has a line of its own."""
    sections: dict[str, list[str]] = {}
    for name in statistics.numbers:
        sections.setdefault(name.rpartition(".")[0] or "scene", []).append(name)
    titles = "".join(f"{title:>{_FIGURE_WIDTH}}" for title in ("mean", "sd", "min", "max"))
    output.print(f"{'':{_NAME_WIDTH}}{titles}  from min to max", style="dim")
    for section, names in sections.items():
        output.print(section, style="bold", highlight=False)
        for name in names:
            tally, meaning = statistics.numbers[name], configured_value(name, scenario)
            figures = "".join(map(_figure, (tally.mean, tally.sd, tally.min, tally.max)))
            line = f"  {name.rpartition('.')[2]:{_NAME_WIDTH - 2}}{figures}  {_histogram(tally):{BINS}}"
            between = "  " if output.width >= _WIDE else "\n    "
            output.print(Text.assemble(line, (f"{between}{meaning}" if meaning else "", "dim")), soft_wrap=True)


def _figure(value: float) -> str:
    """A number for a column with three significant digits, or two if it is tiny."""
    form = "0f" if abs(value) >= 100 else "3g" if abs(value) >= 0.01 else "2g"
    return f"{value:{_FIGURE_WIDTH}.{form}}"


def _histogram(tally: Tally) -> str:
    """One character for each bin, empty for a single value; bins that are not empty have at least the lowest bar."""
    return _bars(tally.shares()) if tally.max > tally.min else ""


def _bars(shares: Float64Array) -> str:
    heights = np.ceil(shares / shares.max() * (len(_BARS) - 1)).astype(int)
    return "".join(_BARS[height] for height in heights.tolist())


def _kinds_table(statistics: SceneStatistics) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("parameter", no_wrap=True)
    table.add_column("shares", overflow="fold")
    for name, counts in statistics.kinds.items():
        shares = (f"{kind} {100 * times / counts.total():.1f}%" for kind, times in counts.most_common())
        table.add_row(name, ", ".join(shares))
    return table
