"""The ``simbev`` command: one verb a file. Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted."""

import sys

import typer
from rich.console import Console

from simbev_ros import __version__
from simbev_ros.cli.bench import bench
from simbev_ros.cli.demo import demo
from simbev_ros.cli.doctor import doctor
from simbev_ros.cli.info import info
from simbev_ros.cli.map import map_
from simbev_ros.cli.preview import preview
from simbev_ros.cli.run import run
from simbev_ros.errors import SimbevError
from simbev_ros.graph.interrupts import Interrupted

app = typer.Typer(
    name="simbev",
    help="Random driving scenes as a ROS 2 graph: sensors, exact bird's-eye-view ground truth, MCAP bags.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _verb in (demo, run, info, preview, doctor, bench):
    app.command()(_verb)
app.command("map")(map_)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"simbev {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Show the version."),
) -> None:
    pass


def main() -> None:
    """Entry point: run a verb and turn errors into messages and exit codes."""
    stderr = Console(stderr=True, soft_wrap=True)
    try:
        app(standalone_mode=True)
    except SimbevError as error:
        stderr.print("[bold red]error:[/]", end=" ")
        stderr.print(str(error), markup=False, highlight=False)
        sys.exit(error.exit_code)
    except (Interrupted, KeyboardInterrupt):
        stderr.print("interrupted")
        sys.exit(130)


if __name__ == "__main__":
    main()
