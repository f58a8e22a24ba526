"""``simbev export t4``: writes a dataset as T4 datasets, for Autoware's perception."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_exporters.cli.image_options import DatasetArgument, Out
from simbev_exporters.cli.nuscenes import AllBoxes, Channels, channel_names
from simbev_exporters.cli.pooled_export import export_agents, show_earlier
from simbev_ros.cli.agent_option import ExportedAgentOption
from simbev_ros.cli.pool import Ray, Workers
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.installation.extras import load_extras

if TYPE_CHECKING:
    from simbev_exporters.t4.export import Exported

_MODULE, _MEMORY_MIB = "simbev_exporters.t4.export", 1024


def export_t4(
    dataset: DatasetArgument,
    out: Out,
    keyframe_hz: Annotated[float, typer.Option(help="Number of samples per second.", min=0.01, max=1000)] = 10.0,
    all_frames: Annotated[bool, typer.Option("--all-frames", help="Every frame is a sample.")] = False,
    all_boxes: AllBoxes = False,
    lidarseg: Annotated[
        bool,
        typer.Option(
            "--lidarseg",
            help="Write the categories of lidar points, where semantic clouds were recorded; not for t4-devkit 0.1.0.",
        ),
    ] = False,
    input_bag: Annotated[bool, typer.Option("--input-bag", help="Copy the scene's bag, with our topics.")] = False,
    channel: Channels = None,
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write each finished scene as a T4 dataset, TIER IV's format for Autoware, which t4-devkit opens.

    A scene's folder has annotation, data, map and status.json; splits.yaml lists the folders of each split. All poses
    are about Autoware's base_link at the rear axle, the clouds of all lidars are LIDAR_CONCAT, and positions are in the
    map frame, that of map/lanelet2_map.osm and of map/pointcloud_map.pcd, which has what is seen along the path.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.

    [bold]Examples[/]

    simbev export t4 datasets/first --out t4

    simbev export t4 datasets/first --out t4 --keyframe-hz 2 --channel camera0=CAM_FRONT
    """
    from simbev_exporters.t4.export import T4Settings
    from simbev_exporters.t4.export import export_t4 as export

    names = channel_names(channel or [])
    settings = T4Settings(None if all_frames else keyframe_hz, all_boxes, lidarseg, input_bag, names)
    export_agents(
        *(dataset, out, agent, workers, ray),
        module=_MODULE,
        memory_mib=_MEMORY_MIB,
        unit="frames",
        export=lambda seen, folder, pool, report: export(seen, folder, settings, pool=pool, report=report),
        report=_report,
    )


def _report(done: "Exported", out: Path, console: Console) -> None:
    """Print what an export has made, and what is missing in it."""
    console.print(f"{done.samples} samples of {plural(done.scenes, 'scene')}, {done.files} files in {out}")
    show_earlier(done, console)
    if not done.has_maps:
        console.print(f"there are no maps: {load_extras()['sim'].remedy('what builds the roads')}")
