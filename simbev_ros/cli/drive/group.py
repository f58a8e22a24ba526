"""The group of commands ``simbev drive``."""

import typer

from simbev_ros.cli.drive.suite import suite

drive = typer.Typer(add_completion=False, rich_markup_mode="rich", no_args_is_help=True)


@drive.callback()
def _group() -> None:
    """Score drivers on routes; [bold]simbev evaluate DATASET[/] scores the drives of any dataset."""


drive.command("suite")(suite)
