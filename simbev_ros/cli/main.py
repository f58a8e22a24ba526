"""Entry point of the ``simbev`` command. Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any

import typer
from rich.console import Console
from typer.core import TyperGroup

from simbev_ros import __version__
from simbev_ros.errors import InputError, SimbevError
from simbev_ros.graph.interrupts import Interrupted, raising_interrupts

VERBS = {
    "demo": "demo:demo",
    "run": "run:run",
    "generate": "generate:generate",
    "replay": "replay:replay",
    "scene": "scene.command:scene",
    "info": "info:info",
    "preview": "preview:preview",
    "verify": "verify:verify",
    "repair": "repair:repair",
    "evaluate": "evaluate.command:evaluate",
    "doctor": "doctor:doctor",
    "map": "map.command:map_",
    "bench": "bench.group:bench",
    "export": "export.group:export",
}
"""Module and function, or group, of each verb, below ``simbev_ros.cli``, in the order of the help."""
_TRACEBACK_VARIABLE = "SIMBEV_TRACEBACK"
_MAX_LENGTH = 300


def load_verb(name: str) -> Callable[..., None] | typer.Typer:
    """Import a verb's module and return the verb: a function, or a group of commands."""
    module, _, attribute = VERBS[name].partition(":")
    return getattr(import_module(f"simbev_ros.cli.{module}"), attribute)


class _LazyVerbs(Mapping[str, Any]):
    """The click command of each verb by name, imported when it is looked up: most verbs take long to load."""

    def __init__(self) -> None:
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            verb = load_verb(name)
            if not isinstance(verb, typer.Typer):
                function, verb = verb, typer.Typer(add_completion=False, rich_markup_mode="rich")
                verb.command(name)(function)
            self._loaded[name] = typer.main.get_command(verb)
            self._loaded[name].name = name
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(VERBS)

    def __len__(self) -> int:
        return len(VERBS)


class _Verbs(TyperGroup):
    """The group of all verbs."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = _LazyVerbs()  # type: ignore[assignment]  # no command is ever added or removed

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the verbs' names without loading the verbs."""
        return list(self.commands)


app = typer.Typer(
    name="simbev",
    cls=_Verbs,
    help="Random driving scenes as a ROS 2 graph: sensors, exact bird's-eye-view ground truth, MCAP bags.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
        from simbev_ros.cli.console import printable

        stderr.print("[bold red]error:[/]", end=" ")
        stderr.print(printable(_message(error)), markup=False, highlight=False)
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
