"""``simbev export t4``: writes a dataset as T4 datasets, for Autoware's perception."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_exporters.cli.image_options import DatasetArgument, Out
from simbev_exporters.cli.nuscenes import AllBoxes, Channels, channel_names
from simbev_ros.cli.agent_option import ExportedAgentOption, exported_agents
from simbev_ros.cli.console import counting_bar, make_console, plural
from simbev_ros.cli.pool import Ray, Workers, open_pool, shared_path
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.extras import load_extras

if TYPE_CHECKING:
    from simbev_exporters.t4.export import Exported, T4Settings

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
    channel: Channels = None,
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write each finished scene as a T4 dataset, TIER IV's format for Autoware, which t4-devkit opens.

    A scene's folder has annotation, data, map and status.json; splits.yaml lists the folders of each split. All poses
    are about Autoware's base_link at the rear axle, the clouds of all lidars are LIDAR_CONCAT, and positions are in the
    map frame, that of map/lanelet2_map.osm.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.

    [bold]Examples[/]

    simbev export t4 datasets/first --out t4

    simbev export t4 datasets/first --out t4 --keyframe-hz 2 --channel camera0=CAM_FRONT
    """
    from simbev_exporters.t4.export import T4Settings

    names = channel_names(channel or [])
    settings = T4Settings(None if all_frames else keyframe_hz, all_boxes, lidarseg, names)
    _export(dataset, out, settings, agent, workers, ray)


def _export(
    dataset: Path, out: Path, settings: "T4Settings", agent: str | None, workers: str | None, ray: str | None
) -> None:
    """Export what the agents have recorded, and print what was made."""
    from simbev_exporters.t4.export import export_t4
    from simbev_ros.dataset import open_dataset

    opened, out = open_dataset(shared_path(dataset, ray), threads=1), shared_path(out, ray)
    failed = scenes = 0
    pooled = open_pool(workers, ray, module=_MODULE, memory_mib=_MEMORY_MIB, reads=[dataset], writes=[out])
    with pooled as pool:
        for seen, folder in exported_agents(opened, agent, out):
            with counting_bar("frames", make_console(stderr=True), elapsed=True) as bar:
                done = export_t4(seen, folder, settings, pool=pool, report=bar.show)
            _report(done, folder)
            failed, scenes = failed + len(done.failures), scenes + len(seen.scenes)
    if failed:
        raise SimbevError(f"{failed} of {plural(scenes, 'scene')} could not be exported")


def _report(done: "Exported", out: Path) -> None:
    """Print what an export has made, and what is missing in it."""
    console = make_console(soft_wrap=True, highlight=False)
    there = done.scenes - done.made
    console.print(f"{done.samples} samples of {plural(done.scenes, 'scene')}, {done.files} files in {out}")
    if there:
        console.print(f"{plural(there, 'scene')} {'was' if there == 1 else 'were'} there already")
    if not done.has_maps:
        console.print(f"there are no Lanelet2 maps: {load_extras()['sim'].remedy('what builds the roads')}")
    for reason in done.failures.values():
        console.print(reason, style="red")
