"""Verbs and exporters that other distributions add by entry points. They are imported when they are called."""

import re
import sys
from collections.abc import Callable, Collection, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer

from simbev_ros.cli.console import own_command
from simbev_ros.foundation.errors import InputError

VERBS_GROUP = "simbev.verbs"
EXPORTERS_GROUP = "simbev.exporters"

_SATELLITES = {
    VERBS_GROUP: {
        "train": ("simbev train", "simbev_training", "'./training[torch]'"),
        "predict": ("simbev predict", "simbev_training", "./training"),
    },
    EXPORTERS_GROUP: {
        name: (f"simbev export {name}", "simbev_exporters", "./exporters")
        for name in ("autoware", "coco", "kitti", "nuscenes", "opv2v", "osi", "t4", "yolo")
    },
}
"""Commands of the distributions in the repository of this one: their words, their distribution, what pip installs."""

_EXAMPLE = re.compile(r"^(\s*|source <\()simbev ", re.MULTILINE)

Command = Callable[..., None] | typer.Typer
"""A function whose parameters typer reads, or a group of such commands."""


def find_plugins(group: str, own: Collection[str]) -> dict[str, EntryPoint]:
    """The entry points of a group by name; to look for them takes some 20 ms.

    Args:
        group: ``VERBS_GROUP`` or ``EXPORTERS_GROUP``.
        own: Names that this distribution has taken.

    Raises:
        InputError: Two distributions give the same name.
    """
    found: dict[str, EntryPoint] = {}
    for each in sorted(entry_points(group=group)):
        if each.name in own or each.name in found:
            other = _distribution(found[each.name]) if each.name in found else "simbev_ros"
            raise InputError(f"{group}: {each.name!r} of {_distribution(each)} is {other}'s already; uninstall one")
        found[each.name] = each
    return found


def require_plugin(group: str, name: str, found: Mapping[str, EntryPoint]) -> None:
    """Refuse a command that a distribution of this repository has, which is not installed.

    Args:
        group: ``VERBS_GROUP`` or ``EXPORTERS_GROUP``.
        name: Name of the command.
        found: The entry points of the group.

    Raises:
        InputError: The command is missing; the message says how to install it.
    """
    if name in _SATELLITES[group] and name not in found:
        words, distribution, target = _SATELLITES[group][name]
        remedy = f"install it in the repository: {sys.executable} -m pip install {target}"
        raise InputError(f"{words} belongs to {distribution}; {remedy}")


def load_plugin(plugin: EntryPoint) -> Command:
    """The command of an entry point; one that cannot be imported becomes a command that says so when it is called."""
    try:
        loaded: Command = plugin.load()
    except (ImportError, AttributeError) as error:
        problem = f"{plugin.name} of {_distribution(plugin)} cannot be imported: {error}"

        def refuse() -> None:
            raise InputError(problem)

        refuse.__doc__ = f"Not available: {problem}."
        return refuse
    return loaded


def click_command(name: str, command: Command) -> Any:
    """The click command of a function or a group."""
    if not isinstance(command, typer.Typer):
        function, command = command, typer.Typer(add_completion=False, rich_markup_mode="rich")
        command.command(name)(function)
    made = typer.main.get_command(command)
    made.name = name
    _say_own_command(made)
    return made


def _say_own_command(command: Any) -> None:
    """Let the examples in the help of a click command, and of those below it, begin as this one was called."""
    if command.help:
        command.help = _EXAMPLE.sub(lambda start: f"{start[1]}{own_command()} ", command.help)
    for each in getattr(command, "commands", {}).values():
        _say_own_command(each)


def _distribution(plugin: EntryPoint) -> str:
    return plugin.dist.name if plugin.dist is not None else plugin.module
