"""The group of commands ``simbev export``."""

import typer

from simbev_ros.cli.export.nuscenes import export_nuscenes
from simbev_ros.cli.export.opv2v import export_opv2v
from simbev_ros.cli.export.simbev import export_simbev

export = typer.Typer(rich_markup_mode="rich", no_args_is_help=True, help="Write a dataset in another layout.")
export.command("simbev")(export_simbev)
export.command("nuscenes")(export_nuscenes)
export.command("opv2v")(export_opv2v)
