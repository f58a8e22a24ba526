"""``simbev export kitti``: writes a dataset in the layout of KITTI's object detection."""

from typing import Annotated

import typer

from simbev_exporters.cli.image_options import (
    Classes,
    DatasetArgument,
    Everything,
    Out,
    Pixels,
    RateHz,
    chosen,
    export_layout,
)
from simbev_ros.cli.agent_option import ExportedAgentOption
from simbev_ros.cli.pool import Ray, Workers


def export_kitti(
    dataset: DatasetArgument,
    out: Out,
    camera: Annotated[
        str | None,
        typer.Option(
            help="Camera of image_2; by default the one that looks most ahead.", metavar="NAME", show_default=False
        ),
    ] = None,
    rate_hz: RateHz = 2.0,
    classes: Classes = None,
    everything: Everything = False,
    pixels: Pixels = 1,
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write finished scenes in the layout of KITTI's object detection: one camera, one lidar, calibration and labels.

    Scenes of train and val are in the folder training, those of test in testing; ImageSets lists the frames of each
    split. The camera needs the modalities rgb and instance.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.

    [bold]Examples[/]

    simbev export kitti datasets/first --out kitti

    simbev export kitti datasets/first --out kitti-back --camera cam_back
    """
    from simbev_exporters.kitti.layout import Kitti

    settings = chosen(rate_hz, classes, pixels, everything=everything)
    cameras = None if camera is None else (camera,)
    export_layout(dataset, out, Kitti(cameras=cameras, **settings), agent, workers, ray)
