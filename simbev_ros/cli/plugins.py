"""Verbs and exporters that other distributions add by entry points. They are imported when they are called."""

from collections.abc import Callable, Collection
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer

from simbev_ros.foundation.errors import InputError

VERBS_GROUP = "simbev.verbs"
EXPORTERS_GROUP = "simbev.exporters"

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
    return made


def _distribution(plugin: EntryPoint) -> str:
    return plugin.dist.name if plugin.dist is not None else plugin.module
