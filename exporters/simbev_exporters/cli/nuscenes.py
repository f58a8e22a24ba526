"""``simbev export nuscenes``: writes a dataset in the layout of nuScenes."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_exporters.cli.pooled_export import export_agents, show_earlier
from simbev_exporters.cli.words import different_words
from simbev_exporters.nuscenes.scene_names import SceneNames
from simbev_ros.cli.agent_option import ExportedAgentOption
from simbev_ros.cli.pool import Ray, Workers
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import load_extras

if TYPE_CHECKING:
    from simbev_exporters.nuscenes.export import Exported

_MODULE, _MEMORY_MIB = "simbev_exporters.nuscenes.export", 1024


KeyframeHz = Annotated[
    float, typer.Option(help="Number of samples, which have annotations, per second.", min=0.01, max=1000)
]
Lidarseg = Annotated[
    bool, typer.Option(help="Write the categories of the lidar's points, if its semantic cloud was recorded.")
]
CanBus = Annotated[bool, typer.Option(help="Write the messages of nuScenes' CAN bus expansion that scenes have.")]
SceneNamesOption = Annotated[
    SceneNames,
    typer.Option(
        metavar="|".join(SceneNames),
        help="Names of scenes in the tables. devkit: scene-2000 and so on, by their numbers, as the devkit's CAN bus "
        "API demands. nuscenes: names from nuScenes' own lists train, val and test, by which MMDetection3D's "
        "converter and others split; tables of test scenes are then in v1.0-test.",
    ),
]
AllBoxes = Annotated[
    bool,
    typer.Option("--all-boxes", help="Annotate boxes without lidar and radar points too, which nuScenes leaves out."),
]
Channels = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        metavar="SENSOR=CHANNEL,…",
        help="Channel of a camera or radar, such as radar_rear=RADAR_BACK_LEFT; several divide a radar's field of "
        "view, from its left. By default radar_left, radar_right and radar_back have nuScenes' names of radars.",
    ),
]


def export_nuscenes(
    dataset: Annotated[Path, typer.Argument(help="A dataset's folder, or one scene's bag.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder to export to, nuScenes' dataroot.", show_default=False)],
    keyframe_hz: KeyframeHz = 2.0,
    all_frames: Annotated[bool, typer.Option("--all-frames", help="Every frame is a sample.")] = False,
    sweeps: Annotated[bool, typer.Option(help="Write the sensor data between samples.")] = True,
    lidarseg: Lidarseg = True,
    map_expansion: Annotated[bool, typer.Option(help="Write the vector maps of nuScenes' map expansion.")] = True,
    can_bus: CanBus = True,
    scene_names: SceneNamesOption = SceneNames.OWN,
    all_boxes: AllBoxes = False,
    channel: Channels = None,
    version: Annotated[str, typer.Option(help="Name of the folder of tables.")] = "v1.0-trainval",
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write finished scenes in the layout of nuScenes for its devkit: tables, samples, sweeps, maps, labels of points.

    Coordinates are nuScenes': relative to the lower left corner of the map's mask, so that none is negative. origin_m
    in the table map is that corner in the frame map; it can move when scenes are added.

    A sample has the data of each sensor at its time, or else the last before it: boxes match the images if the rates of
    all sensors are multiples of --keyframe-hz.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.
    The devkit's splits are lists of nuScenes' scenes. Ours are in splits.json next to the tables, as simbev_train,
    simbev_val and simbev_test; the devkit finds them there from its release 1.2 on.

    [bold]Examples[/]

    simbev export nuscenes datasets/first --out exported

    simbev export nuscenes datasets/first --out exported --keyframe-hz 4 --no-sweeps

    simbev export nuscenes datasets/first --out exported --scene-names nuscenes

    simbev export nuscenes datasets/several --out exported --agent all

    simbev export nuscenes /shared/datasets/first --out /shared/exported --ray auto
    """
    from simbev_exporters.nuscenes.export import ExportSettings
    from simbev_exporters.nuscenes.export import export_nuscenes as export

    rate_hz = None if all_frames else keyframe_hz
    named = channel_names(channel or [])
    settings = ExportSettings(rate_hz, sweeps, lidarseg, map_expansion, can_bus, scene_names, version, all_boxes, named)
    export_agents(
        *(dataset, out, agent, workers, ray),
        module=_MODULE,
        memory_mib=_MEMORY_MIB,
        unit="frames",
        export=lambda seen, folder, pool, report: export(seen, folder, settings, pool=pool, report=report),
        report=_report,
    )


def channel_names(options: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Channels by sensor, from the values of --channel.

    Raises:
        InputError: A value has another form.
    """
    names = {}
    for option in options:
        sensor, _, channels = option.partition("=")
        if not sensor or not channels:
            raise InputError(
                f"{option!r} must be SENSOR=CHANNEL, as in radar_rear=RADAR_BACK_LEFT", parameter="channel"
            )
        names[sensor] = different_words("channel", channels)
    return names


def _report(done: "Exported", out: Path, console: Console) -> None:
    """Print what an export has made, and what is missing in it."""
    console.print(f"{done.samples} samples of {plural(done.scenes, 'scene')}, {done.files} files in {out}")
    show_earlier(done, console)
    for place, (x_m, y_m) in done.origins_m.items():
        console.print(f"{place}: nuScenes' origin is at x {x_m:g} m, y {y_m:g} m of the map (origin_m in map.json)")
    for why in sorted(set(done.unlabeled.values())):
        count = sum(each == why for each in done.unlabeled.values())
        console.print(f"{plural(count, 'scene')} without categories of lidar points: {why}")
    if not done.has_roads:
        remedy = load_extras()["sim"].remedy("what draws the roads")
        console.print(f"masks of maps are empty, and there are no vector maps: {remedy}")
    if done.without_imu:
        console.print(
            f"{plural(done.without_imu, 'scene')} without ms_imu in the CAN bus messages: no IMU was recorded"
        )
    for line in _bounds_of_map(done.classes):
        console.print(line)


def _bounds_of_map(classes: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Lines of text that say which mAP perfect detections have in nuScenes' evaluation, by split."""
    from simbev_ros.schema.nuscenes import detection_ranges_m

    known = list(detection_ranges_m())
    for split, found in classes.items():
        missing = [name for name in known if name not in found]
        if missing:
            share = f"{len(found)} of {len(known)} classes occur, so perfect detections have a mAP of"
            yield f"{split}: {share} {len(found) / len(known):g} in nuScenes' evaluation; not: {', '.join(missing)}"
