"""Entry point of the ``simbev`` command. Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted."""

import errno
import io
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from importlib.metadata import EntryPoint
from itertools import pairwise
from typing import Any

import typer
from typer.core import TyperGroup

from simbev_ros import __version__
from simbev_ros.cli.console import make_console
from simbev_ros.cli.plugins import VERBS_GROUP, Command, click_command, find_plugins, load_plugin, require_plugin
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.installation.extras import extra_of, require_extras
from simbev_ros.foundation.installation.shell_variables import describe_loader, prepare_shell
from simbev_ros.foundation.process_limits import (
    COMMAND_NEEDS,
    describe_shortage,
    is_shortage,
    message_with_limit,
    require_graph_limits,
    require_limits,
)
from simbev_ros.ros.conventions.arguments import split_ros_arguments
from simbev_ros.ros.graph.interrupts import Interrupted, raising_interrupts

VERBS = {
    "demo": "demo:demo",
    "run": "run:run",
    "generate": "generate:generate",
    "replay": "replay:replay",
    "scene": "scene.command:scene",
    "info": "info:info",
    "preview": "preview:preview",
    "gallery": "gallery:gallery",
    "view": "view.command:view",
    "verify": "verify:verify",
    "logs": "logs:logs",
    "repair": "repair:repair",
    "drop": "drop:drop",
    "evaluate": "evaluate.command:evaluate",
    "drive": "drive.group:drive",
    "realism": "realism:realism",
    "doctor": "doctor:doctor",
    "env": "env:env",
    "map": "map.command:map_",
    "bench": "bench:bench",
    "export": "export.group:export",
}
"""Module and function, or group, of each verb, below ``simbev_ros.cli``, in the order of the help."""
_NAME = "simbev"
_GO_ON = ("generate", "replay", "export", "drive")
"""Verbs that keep what an interrupted call has made, and go on from there."""
_TAKE_URLS = ("generate", "drop", "info", "logs", "verify")
"""Verbs that work with datasets in object stores."""
_SIMULATOR, _GRAPH = ("sim",), ("sim", "wheels")
_NEEDED_EXTRAS = {
    **dict.fromkeys(("demo", "run", "generate", "replay", "bench", "drive"), _GRAPH),
    **dict.fromkeys(("scene", "gallery", "map"), _SIMULATOR),
    "env": ("wheels",),
}
"""Extras of the verbs that the base installation does not have; parts of others say so themselves."""
_USE_ROS = (*(verb for verb, extras in _NEEDED_EXTRAS.items() if "wheels" in extras), "view")
_TAKE_ROS_ARGUMENTS = ("run", "replay", "view")
"""Verbs that pass on what follows --ros-args to nodes."""
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://")
_SCRIPTS_COMMANDS = (
    "Also commands of ./simbev: setup EXTRA,… adds optional parts; test, fuzz and docs are for developers."
)
_TRACEBACK_VARIABLE = "SIMBEV_TRACEBACK"
_MAX_LENGTH = 300


def load_verb(name: str) -> Command:
    """Import the module of one of our verbs and return the verb."""
    module, _, attribute = VERBS[name].partition(":")
    return getattr(import_module(f"simbev_ros.cli.{module}"), attribute)


class _LazyVerbs(Mapping[str, Any]):
    """The click command of each verb by name, imported when it is looked up: most verbs take long to load.

    Verbs of other distributions are looked for when none of ours has the name, and for the help.
    """

    def __init__(self) -> None:
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            self._loaded[name] = click_command(name, load_verb(name) if name in VERBS else self._load_plugin(name))
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter([*VERBS, *self._plugins])

    def __len__(self) -> int:
        return len(VERBS) + len(self._plugins)

    @cached_property
    def _plugins(self) -> Mapping[str, EntryPoint]:
        return find_plugins(VERBS_GROUP, VERBS)

    def _load_plugin(self, name: str) -> Command:
        """Import the verb of another distribution; KeyError if there is none of this name."""
        require_plugin(VERBS_GROUP, name, self._plugins)
        return load_plugin(self._plugins[name])


def _values(arguments: Sequence[str]) -> Iterator[str]:
    """Arguments and values of options, which may be names of files, without the value of ``--ray``."""
    for before, argument in pairwise(("", *arguments)):
        option, _, value = argument.partition("=") if argument.startswith("--") else ("", "", argument)
        if "--ray" not in (before, option):
            yield value


def _require_machine(verb: str) -> None:
    """Check what a verb needs of this machine, before it is loaded: its libraries crash where limits are too low."""
    extras = _NEEDED_EXTRAS.get(verb, ())
    require_extras(extras, f"simbev {verb}")
    if extras == _GRAPH:
        require_graph_limits()
    elif verb != "doctor":  # it reports them
        require_limits(f"simbev {verb}", COMMAND_NEEDS)


class _Verbs(TyperGroup):
    """The group of all verbs."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = _LazyVerbs()  # type: ignore[assignment]  # no command is ever added or removed

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Set ROS's arguments aside, which launch files also add where they are none: see ``ros_arguments``."""
        own, ctx.obj = split_ros_arguments(args)
        return list(super().parse_args(ctx, own))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the verb; refuse what it does not take: URLs instead of local files, ROS's arguments."""
        if not {"-h", "--help"} & {*args[1:]}:
            _require_machine(args[0])
        name, command, rest = super().resolve_command(ctx, args)
        if name in _USE_ROS:
            prepare_shell()
        if ctx.obj and name not in _TAKE_ROS_ARGUMENTS:
            others = f"{', '.join(_TAKE_ROS_ARGUMENTS[:-1])} and {_TAKE_ROS_ARGUMENTS[-1]}"
            raise InputError(f"--ros-args: simbev {name} takes no arguments for nodes; {others} do")
        url = next((each for each in _values(rest) if _URL.match(each)), None)
        if url is not None and name not in _TAKE_URLS:
            others = f"{', '.join(_TAKE_URLS[:-1])} and {_TAKE_URLS[-1]}"
            raise InputError(f"{url}: simbev {name} needs a local folder; {others} take URLs")
        return name, command, rest

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the verbs' names without loading the verbs."""
        return list(self.commands)


app = typer.Typer(
    name=_NAME,
    cls=_Verbs,
    help="Random driving scenes as a ROS 2 graph: sensors, exact bird's-eye-view ground truth, MCAP bags.",
    epilog=_SCRIPTS_COMMANDS if "SIMBEV_COMMAND" in os.environ else None,
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
    run_app(app, _NAME)


def run_app(commands: typer.Typer, name: str) -> None:
    """Run an application with the arguments of this process, and turn errors into messages and exit codes.

    Args:
        commands: The application.
        name: Its name in messages.
    """
    os.environ["PYTHONSAFEPATH"] = "1"  # no child process takes modules from the current folder
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files need not be UTF-8
    stderr = make_console(stderr=True, soft_wrap=True)
    try:
        with raising_interrupts():
            commands(prog_name=name, standalone_mode=True)
    except (Interrupted, KeyboardInterrupt):
        verb = next(iter(sys.argv[1:]), "")
        stderr.print("interrupted; the same command goes on from here" if verb in _GO_ON else "interrupted")
        sys.exit(130)
    except Exception as error:
        if os.environ.get(_TRACEBACK_VARIABLE) and not isinstance(error, InputError):
            raise
        stderr.print("error:", style="bold red", end=" ")
        stderr.print(_message(error), highlight=False)
        sys.exit(_exit_code(error))


def _exit_code(error: Exception) -> int:
    if isinstance(error, SimbevError):
        return error.exit_code
    if isinstance(error, ImportError) and (extra_of(error) or describe_loader()):
        return InputError.exit_code
    is_input = isinstance(error, OSError) and error.filename is not None and error.errno != errno.EIO
    return InputError.exit_code if is_input and not is_shortage(error) else SimbevError.exit_code


def _message(error: Exception) -> str:
    """The message for the user; that of an unexpected error includes the step that was running."""
    if isinstance(error, InputError) and error.parameter is not None:
        option = f"--{error.parameter.replace('_', '-')}"
        return option + str(error).removeprefix(error.parameter)
    if isinstance(error, SimbevError):
        return message_with_limit(error)
    while_what = "".join(f", {note}" for note in getattr(error, "__notes__", ()))
    problem = describe_shortage(error)
    if isinstance(error, OSError) and error.strerror:  # of this machine, its disks or its limits
        where = "" if error.filename is None else f"{os.fsdecode(error.filename)!s:.{_MAX_LENGTH}}: "
        return f"{where}{problem or error.strerror}{while_what}"
    if problem is not None:
        return f"{problem}{while_what}"
    if isinstance(error, ImportError):
        if extra := extra_of(error):
            return extra.remedy("this")
        if loader := describe_loader():
            first, *_ = str(error.__cause__ or error).splitlines() or [""]
            return f"{first}{while_what}; {loader}"
        return f"{error}{while_what}; simbev doctor says what this machine lacks"
    return (
        f"this is a bug in simbev: {type(error).__name__}: {error!s:.{_MAX_LENGTH}}{while_what}\n"
        f"Please report it. With {_TRACEBACK_VARIABLE}=1 the traceback is shown"
    )


if __name__ == "__main__":
    main()
