"""Entry point of the ``simbev`` command. Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted."""

import os
import sys

import typer
from rich.console import Console

from simbev_ros import __version__
from simbev_ros.cli.bench.group import bench
from simbev_ros.cli.demo import demo
from simbev_ros.cli.doctor import doctor
from simbev_ros.cli.evaluate.command import evaluate
from simbev_ros.cli.export.group import export
from simbev_ros.cli.generate import generate
from simbev_ros.cli.info import info
from simbev_ros.cli.map import map_
from simbev_ros.cli.preview import preview
from simbev_ros.cli.repair import repair
from simbev_ros.cli.replay import replay
from simbev_ros.cli.run import run
from simbev_ros.cli.scene import scene
from simbev_ros.cli.verify import verify
from simbev_ros.errors import InputError, SimbevError
from simbev_ros.graph.interrupts import Interrupted, raising_interrupts

_TRACEBACK_VARIABLE = "SIMBEV_TRACEBACK"
_MAX_LENGTH = 300

app = typer.Typer(
    name="simbev",
    help="Random driving scenes as a ROS 2 graph: sensors, exact bird's-eye-view ground truth, MCAP bags.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _verb in (demo, run, generate, replay, scene, info, preview, verify, repair, evaluate, doctor):
    app.command()(_verb)
app.command("map")(map_)
app.add_typer(bench, name="bench")
app.add_typer(export, name="export")


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
        with raising_interrupts():
            app(standalone_mode=True)
    except (Interrupted, KeyboardInterrupt):
        stderr.print("interrupted")
        sys.exit(130)
    except Exception as error:
        if os.environ.get(_TRACEBACK_VARIABLE) and not isinstance(error, InputError):
            raise
        stderr.print("[bold red]error:[/]", end=" ")
        stderr.print(_message(error), markup=False, highlight=False)
        sys.exit(error.exit_code if isinstance(error, SimbevError) else SimbevError.exit_code)


def _message(error: Exception) -> str:
    """The message for the user; that of an unexpected error includes the step that was running."""
    if isinstance(error, InputError) and error.parameter is not None:
        option = f"--{error.parameter.replace('_', '-')}"
        return option + str(error).removeprefix(error.parameter)
    if isinstance(error, SimbevError):
        return str(error)
    while_what = "".join(f", {note}" for note in getattr(error, "__notes__", ()))
    if isinstance(error, MemoryError):
        return f"memory ran out{while_what}"
    return (
        f"this is a bug in simbev: {type(error).__name__}: {error!s:.{_MAX_LENGTH}}{while_what}\n"
        f"Please report it. With {_TRACEBACK_VARIABLE}=1 the traceback is shown"
    )


if __name__ == "__main__":
    main()
