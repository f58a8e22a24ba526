"""The group of commands ``simbev view``; without one of their names, it shows a recorded scene."""

from typing import Any

import typer
from typer.core import TyperGroup

from simbev_ros.cli.view.foxglove import foxglove
from simbev_ros.cli.view.live import live
from simbev_ros.cli.view.recorded import recorded
from simbev_ros.foundation.errors import InputError

_RECORDED = "recorded"


class _Views(TyperGroup):
    """The group; ``simbev view out/demo`` is short for ``simbev view recorded out/demo``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the command's name where it was left out."""
        if args and args[0] not in (*self.commands, *ctx.help_option_names):
            args = [_RECORDED, *args]
        if ctx.obj and args[:1] == [_RECORDED]:
            raise InputError("--ros-args: is for running graphs: simbev view live, simbev view foxglove")
        return list(super().parse_args(ctx, args))


view = typer.Typer(
    cls=_Views,
    add_completion=False,
    rich_markup_mode="rich",
    no_args_is_help=True,
    help="Look at a recorded scene or a running graph in Rerun's viewer, Foxglove or Lichtblick; "
    "simbev view BAG shows a recorded one.",
)
for _function in (recorded, live, foxglove):
    view.command(_function.__name__)(_function)
