"""``simbev drive suite``: plays the suite of drives with a driver, and scores it."""

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from simbev_ros.cli.console import make_console, plural
from simbev_ros.cli.output_file import require_place
from simbev_ros.cli.pool import MAX_GRAPHS, worker_count
from simbev_ros.cli.scene_options import GraphRay, GraphWorkers
from simbev_ros.config.included_stacks import INCLUDED_DRIVERS
from simbev_ros.foundation.files.whole_files import write_errors, write_whole

if TYPE_CHECKING:
    from simbev_ros.production.drive_suite import SuiteDrive


class Interface(StrEnum):
    """``ego.driver`` for a driver outside."""

    ACKERMANN = "ackermann"
    TRAJECTORY = "trajectory"
    PATH = "path"


def suite(
    stack: Annotated[
        str,
        typer.Option(
            help=f"Command that starts the driver, or {', '.join(INCLUDED_DRIVERS)}, traffic, none.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the datasets of the abilities.", show_default=False)],
    routes: Annotated[int | None, typer.Option(help="Number of routes; default: all 220.", min=1, max=220)] = None,
    interface: Annotated[
        Interface, typer.Option(help="What a command's driver publishes: ego.driver in a configuration.")
    ] = Interface.ACKERMANN,
    workers: GraphWorkers = None,
    ray: GraphRay = None,
    report: Annotated[Path | None, typer.Option(help="Write a page with pictures.", metavar="FILE.html")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all figures.", metavar="FILE.json")] = None,
) -> None:
    """Drive routes on all towns, and score them by ability, town, weather and time of day.

    The same driver gets the same scores on any number of workers. Existing drives are kept, so the same command goes on
    after an interruption, and with more routes. A driver that dies or stops is scored, too.

    [bold]Examples[/]

    simbev drive suite --stack drive-truth --out drives/truth --routes 20 --report truth.html

    simbev drive suite --stack ".venv/bin/python my_driver.py" --out drives/mine --workers auto --json mine.json

    [bold]A driver, my_driver.py[/]

    \b
    import rclpy
    from ackermann_msgs.msg import AckermannDriveStamped
    from nav_msgs.msg import Odometry
    from simbev_ros.join import Driver
    def decide(inputs, scene):
        command = AckermannDriveStamped()
        command.drive.speed = 5.0
        return command
    rclpy.init()
    node = rclpy.create_node("driver")
    Driver(node, decide, {"/ego/odom": Odometry}, ("/ego/ackermann_cmd", AckermannDriveStamped))
    rclpy.spin(node)
    """  # noqa: D301  # a paragraph that begins with a backspace is not wrapped
    from simbev_ros.cli.generate import show_failures
    from simbev_ros.cli.production_display import DatasetDisplay
    from simbev_ros.production.drive_suite import make_suite, suite_drives, suite_scenarios, suite_size

    for path in filter(None, (report, json_file)):
        require_place(path)
    console, count = make_console(), worker_count(workers, MAX_GRAPHS)
    scenarios = suite_scenarios(stack, interface.value, routes or suite_size())
    results = make_suite(scenarios, out, workers=count, ray=ray, observer=DatasetDisplay(console))
    failed = {f"{ability}/{name}": why for ability, each in results.items() for name, why in each.failed.items()}
    show_failures(failed, console)
    if drives := suite_drives(scenarios, out):
        _show(drives, stack, report, json_file)
    raise typer.Exit(0 if drives and all(each.is_complete for each in results.values()) else 1)


def _show(drives: "list[SuiteDrive]", stack: str, report: Path | None, json_file: Path | None) -> None:
    """Print the scores, and write them to the files that are asked for."""
    from simbev_ros.cli.evaluate.tables import print_figure_tables
    from simbev_ros.evaluation.driving.tables import drive_tables
    from simbev_ros.production.drive_suite import suite_figures, suite_tables

    console, figures = make_console(highlight=False), suite_figures(drives, stack)
    console.print(f"{plural(len(drives), 'drive')} by {stack}")
    judged = [each.drive for each in drives]
    print_figure_tables([*drive_tables(judged, figures), *suite_tables(figures)], console)
    if json_file is not None:
        _write(json_file, figures)
        console.print(f"figures in {json_file}", soft_wrap=True)
    if report is not None:
        from simbev_ros.show.reports.drive_report import write_drive_report

        write_drive_report(report, f"drives by {stack}", [each.scene for each in drives], judged, figures)
        console.print(f"report in {report}", soft_wrap=True)


def _write(path: Path, figures: dict[str, Any]) -> None:
    with write_errors(path):
        write_whole(path, json.dumps(figures, indent=2).encode() + b"\n")
