"""``simbev export autoware``: writes a rig and its vehicle as description packages of Autoware."""

from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.agent_option import AgentOption
from simbev_ros.cli.console import make_console
from simbev_ros.foundation.installation.extras import load_extras


def export_autoware(
    source: Annotated[
        str, typer.Argument(help="Configuration file or its name; or a dataset or a bag.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(help="Folder of the packages, such as src of a workspace.", show_default=False)],
    name: Annotated[str, typer.Option(help="Begin of the names of the packages.")] = "simbev",
    agent: AgentOption = None,
) -> None:
    """Write the rig and the vehicle as packages that Autoware takes as sensor_model and vehicle_model.

    NAME_vehicle_description has vehicle_info.param.yaml and the shape; NAME_sensor_kit_description has the calibrations
    and the frames of all sensors, with the names that their messages have. base_link is at the rear axle.

    [bold]Examples[/]

    simbev export autoware config/autoware/simbev.yaml --out ~/autoware/src/simbev

    simbev export autoware datasets/first --out ~/autoware/src/simbev --name my_car
    """
    load_extras()["sim"].require("simbev export autoware")
    from simbev_exporters.autoware.export import export_packages

    console = make_console(soft_wrap=True, highlight=False)
    for folder in export_packages(source, out, name, agent):
        console.print(folder)
