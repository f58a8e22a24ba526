"""The group of commands ``simbev export``: our exporters, and those of other distributions."""

from collections.abc import Callable, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint
from typing import Any

import typer
from typer.core import TyperGroup

from simbev_ros.cli.export.simbev import export_simbev
from simbev_ros.cli.plugins import EXPORTERS_GROUP, click_command, find_plugins, load_plugin, require_plugin

_OWN: dict[str, Callable[..., None]] = {"simbev": export_simbev}


class _Exporters(TyperGroup):
    """The group with the exporters of other distributions."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all exporters."""
        return [*_OWN, *self._plugins]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return an exporter; None if there is none of this name."""
        if cmd_name not in _OWN:
            require_plugin(EXPORTERS_GROUP, cmd_name, self._plugins)
        if cmd_name not in self._plugins:
            return super().get_command(ctx, cmd_name)
        return click_command(cmd_name, load_plugin(self._plugins[cmd_name]))

    @cached_property
    def _plugins(self) -> Mapping[str, EntryPoint]:
        return find_plugins(EXPORTERS_GROUP, _OWN)


export = typer.Typer(cls=_Exporters, add_completion=False, rich_markup_mode="rich", no_args_is_help=True)


@export.callback()
def _group() -> None:
    """Write a dataset in another layout."""


for _name, _command in _OWN.items():
    export.command(_name)(_command)
