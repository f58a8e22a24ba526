"""``simbev realism``: prints how far a dataset's sensors are from real ones."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from simbev_ros.cli.console import make_console, table_console
from simbev_ros.cli.output_file import require_place, show_written
from simbev_ros.foundation.files.whole_files import write_errors

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
    report: Annotated[
        Path | None, typer.Option(help="Also write a page with curves.", metavar="FILE.html", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Compare lidar, images and radar with real frames: intensities, losses, noise, spectrum, cross-sections.

    A row is marked where ours lies outside the span of the single real samples, by more than a tenth.

    [bold]Examples[/]

    simbev realism datasets/kitti_rig --against KITTI/training --report realism.html

    simbev realism datasets/first --against nuscenes/samples --json
    """
    from simbev_ros.dataset import open_dataset
    from simbev_ros.evaluation.realism.comparison import compare
    from simbev_ros.evaluation.realism.samples import samples_of_dataset, samples_of_folder

    if report is not None:
        require_place(report)
    with make_console(stderr=True).status("reading frames"):
        real = samples_of_folder(against, samples)
        ours = samples_of_dataset(open_dataset(dataset), samples)
        rows = compare(ours, real)
    if as_json:
        print(json.dumps([_record(row) for row in rows], indent=2))
    else:
        sensors = dict.fromkeys(row.sensor for row in rows)
        tables = [_table(sensor, [row for row in rows if row.sensor == sensor]) for sensor in sensors]
        table_console().print(*tables, sep="\n")
    if report is not None:
        from simbev_ros.show.reports.realism_report import write_realism_report

        with write_errors(report):
            write_realism_report(report, rows, ours, real)
        show_written([report], make_console(stderr=as_json))


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
        "low": row.low,
        "high": row.high,
        "inside": row.is_inside,
    }
