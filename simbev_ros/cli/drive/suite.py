"""``simbev drive suite``: plays the suite of drives with a driver, and scores it."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.cli.evaluate.drives import show_drives
from simbev_ros.cli.generate import show_failures
from simbev_ros.cli.output_file import require_place
from simbev_ros.cli.pool import MAX_GRAPHS, worker_count
from simbev_ros.cli.scene_options import GraphRay, GraphWorkers
from simbev_ros.config.included_stacks import INCLUDED_DRIVERS
from simbev_ros.foundation.counts import plural


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
    from simbev_ros.cli.production_display import DatasetDisplay
    from simbev_ros.production import drive_suite

    for path in filter(None, (report, json_file)):
        require_place(path)
    console, count = make_console(), worker_count(workers, MAX_GRAPHS)
    scenarios = drive_suite.suite_scenarios(stack, interface.value, routes or drive_suite.suite_size())
    names = {ability: f"{ability} ({number} of {len(scenarios)})" for number, ability in enumerate(scenarios, start=1)}
    displays = {ability: DatasetDisplay(console, name) for ability, name in names.items()}
    results = drive_suite.make_suite(scenarios, out, workers=count, ray=ray, observers=displays)
    failed = {f"{ability}/{name}": why for ability, each in results.items() for name, why in each.failed.items()}
    show_failures(failed, console)
    if drives := drive_suite.suite_drives(scenarios, out):
        figures, words = drive_suite.suite_figures(drives, stack), f"{plural(len(drives), 'drive')} by {stack}"
        scenes, judged = [each.scene for each in drives], [each.drive for each in drives]
        tables = drive_suite.suite_tables(figures)
        show_drives(f"drives by {stack}", [words], scenes, judged, figures, tables, report=report, json_file=json_file)
    raise typer.Exit(0 if drives and all(each.is_complete for each in results.values()) else 1)
