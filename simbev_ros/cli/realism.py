"""``simbev realism``: prints how far a dataset's sensors are from real ones."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from simbev_ros.cli.console import make_console, table_console

if TYPE_CHECKING:
    from simbev_ros.evaluation.realism.comparison import Row

_DIGITS = 4


def realism(
    dataset: Annotated[
        Path, typer.Argument(help="The dataset, or one scene's bag.", metavar="DATASET", show_default=False)
    ],
    against: Annotated[
        Path,
        typer.Option(
            help="Folder of real frames: KITTI's .bin, nuScenes' .bin and .pcd, Argoverse 2's .feather, .jpg, .png.",
            metavar="FOLDER",
            show_default=False,
        ),
    ],
    samples: Annotated[int, typer.Option(help="Samples of each sensor.", min=1, max=10_000)] = 40,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Compare lidar, images and radar with real frames: intensities, losses, noise, spectrum, cross-sections.

    A row is marked where ours lies outside the span of the real sensors, by more than a tenth of it.

    [bold]Examples[/]

    simbev realism datasets/kitti_rig --against KITTI/training

    simbev realism datasets/first --against nuscenes/samples --json
    """
    from simbev_ros.dataset import open_dataset
    from simbev_ros.evaluation.realism.comparison import compare
    from simbev_ros.evaluation.realism.samples import samples_of_dataset, samples_of_folder

    with make_console().status("reading frames"):
        real = samples_of_folder(against, samples)
        rows = compare(samples_of_dataset(open_dataset(dataset), samples), real)
    if as_json:
        print(json.dumps([_record(row) for row in rows], indent=2))
    else:
        table_console().print(*map(_table, {row.sensor: [] for row in rows}, _by_sensor(rows)), sep="\n")


def _by_sensor(rows: "list[Row]") -> "list[list[Row]]":
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.sensor, []).append(row)
    return list(groups.values())


def _table(sensor: str, rows: "list[Row]") -> Table:
    table = Table(title=sensor, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("", "ours", "real", ""):
        table.add_column(heading, justify="left" if not heading else "right")
    for row in rows:
        span = f"{row.low:.{_DIGITS}g}" + (f" to {row.high:.{_DIGITS}g}" if row.high > row.low else "")
        mark = Text() if row.is_inside else Text("outside", style="yellow")
        table.add_row(row.figure, f"{row.ours:.{_DIGITS}g}", span, mark)
    return table


def _record(row: "Row") -> dict[str, object]:
    return {
        "sensor": row.sensor,
        "figure": row.figure,
        "ours": row.ours,
        "real": dict(row.real),
        "inside": row.is_inside,
    }
